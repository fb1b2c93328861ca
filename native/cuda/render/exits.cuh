// The stage at a surface where a walk under it comes out: lit and scattered as from a white diffuse one.
#pragma once
#include "luch/integrator/photon.h"
#include "luch/integrator/subsurface.h"
#include "render/onward.cuh"

namespace luch {

__device__ __forceinline__ void shade_exit(const RenderTask& task, const SubsurfaceWalk& walk) {
    const Wavefront& wave = task.wave;
    const RenderView& scene = task.scene;
    u32 slot = wave.ray_slot[walk.ray];
    StageTimer timer(wave, CLOCK_EXITS, slot);
    const Program& program = scene.view.materials[material_at(scene.view, walk.hit.instance, walk.hit.prim)].program;
    PathState path = load_path(wave, slot);
    path.throughput = walk.throughput;
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    float time = time_of_ray(wave, walk.ray);
    SurfacePoint spawn = exit_point(scene, walk, time);
    setup_surface_lane(scene.view, exit_inputs(path, slot, walk, spawn, time), points, 0);
    Vec3 normal = lane_normal(points, 0);
    if (plan::BENT_EXITS && (program.flags & PROGRAM_SUBSURFACE_BUMP)) {
        run_program(context_of(scene.view, program, points, set, nullptr));
        normal = exit_normal(set, normal);
    }
    setup_exit(set, points, 0, normal);
    if (scene.has_lights) light_surface(task, path, slot, points, set, spawn);
    if constexpr (plan::PHOTONS) {
        FilmWriter writer = film_of_slot(task, slot);
        add_photons(scene, writer, path, points, 0, set);
        add_totals(wave, writer);
    }
    send_on(task, path, slot, points, set, spawn, -walk.direction, 0.0f);
    store_path(wave, slot, path);
}

}  // namespace luch

LUCH_STAGE(shade_exits) {
    using namespace luch;
    u32 k = stage_index();
    if constexpr (plan::SUBSURFACE) {
        if (k >= task.wave.counters[WAVE_WALKS]) return;
        SubsurfaceWalk walk = task.wave.walks[k];
        add_total(task.wave, TOTAL_WALKS, 1);
        if (walk.hit.instance != NONE) shade_exit(task, walk);
    }
}

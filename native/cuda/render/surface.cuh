// The stage at a surface: its program, its emission, what it tells the film, a light for it, and where the path goes.
#pragma once
#include "luch/integrator/photon.h"
#include "render/onward.cuh"
#include "render/subsurface.cuh"

namespace luch {

// The path goes on through a surface that is only the border of a volume.
__device__ __noinline__ void pass_border(const RenderTask& task, PathState& path, u32 slot, const Hit& hit, float time,
                                         Ray ray) {
    const Wavefront& wave = task.wave;
    path.travelled += hit.t;
    ray.t_min = 0.0f, ray.t_max = INFINITE_DISTANCE;
    pass_surface(task.scene.view, wave.media[slot], hit, time, &ray);
    store_path(wave, slot, path);
    push_ray(wave, ray, time, slot, path.visibility);
}

// entry: of the sorted queue. True when the surface was shaded.
__device__ __forceinline__ bool shade_entry(const RenderTask& task, u32 entry) {
    const Wavefront& wave = task.wave;
    const RenderView& scene = task.scene;
    u32 k = wave.sorted[entry], slot = wave.ray_slot[k];
    StageTimer timer(wave, CLOCK_SURFACES, slot);
    Hit hit = wave.hits[k];
    Ray ray = wave.rays[k];
    u32 material_index = material_at(scene.view, hit.instance, hit.prim);
    const MaterialView& material = scene.view.materials[material_index];
    PathState path = load_path(wave, slot);
    if (plan::VOLUMES && material.only_volume) {
        pass_border(task, path, slot, hit, time_of_ray(wave, k), ray);
        return false;
    }
    FilmWriter writer = film_of_slot(task, slot);
    if (!survives(scene, writer, path, material)) {
        add_totals(wave, writer);
        return false;
    }
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    float time = time_of_ray(wave, k);
    SurfacePoint spawn = setup_hit_lane(scene, path, slot, hit, ray, time, points, 0);
    u32 aov_floats = 4u * task.film.layout.aov_count;
    float* aovs = wave.aovs ? wave.aovs + u64(entry) * aov_floats : nullptr;
    for (u32 i = 0; aovs && i < aov_floats; ++i) aovs[i] = 0.0f;
    run_program(context_of(scene.view, material.program, points, set, aovs));
    if (meet_surface(scene, writer, path, points, 0, set, material_index, aovs)) {
        if (scene.has_lights) light_surface(task, path, slot, points, set, spawn);
        add_photons(scene, writer, path, points, 0, set);
        if (wants_ao(task.film.layout, path)) {
            Ray ao_ray;
            ShadowRay ao;
            make_ao_ray(scene, path, slot, points, 0, set, spawn, &ao_ray, &ao);
            push_shadow(wave, ao_ray, time, ao, media_of(wave, slot));
        }
        bool inside = plan::SUBSURFACE && scene.has_subsurface && goes_inside(task, path, points, set, spawn, k);
        if (!inside) send_on(task, path, slot, points, set, spawn, ray.direction, hit.t);
        store_path(wave, slot, path);
    }
    add_totals(wave, writer);
    return true;
}

}  // namespace luch

LUCH_STAGE(shade_surfaces) {
    using namespace luch;
    u32 entry = stage_index();
    bool shaded = entry < task.wave.counters[WAVE_HITS] && shade_entry(task, entry);
    u32 count = u32(popcount(__ballot_sync(0xffffffffu, shaded)));
    if (threadIdx.x % 32u == 0) add_total(task.wave, TOTAL_SURFACE_POINTS, count);
}

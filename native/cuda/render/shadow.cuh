// The stage after shadow rays were traced: what reached its light enters the film.
#pragma once
#include "luch/integrator/direct_light.h"
#include "render/one_ray.cuh"
#include "render/stage.cuh"

namespace luch {

__device__ __forceinline__ Color shadow_transmittance(const RenderTask& task, const SceneTrees& trees, u32 k,
                                                      const ShadowRay& shadow) {
    const Wavefront& wave = task.wave;
    if (!shadow.casts) return make_vec3(1.0f);
    bool media = plan::VOLUMES && wave.media;
    if (wave.blocked[k] == BLOCKED_NOT) {
        if (!media) return make_vec3(1.0f);
        return media_transmittance(task.scene.media, wave.shadow_media[k], wave.shadow_rays[k].t_max);
    }
#if LUCH_TRANSPARENT
    if (wave.blocked[k] == BLOCKED_MAYBE) {
        ShadePoints points;
        ClosureSet set;
        PointShader shader{task.scene.view, set};
        OneRay tracer{trees, plan::MOTION && wave.shadow_time ? wave.shadow_time[k] : SHUTTER_MIDDLE};
        u64 steps = 0, rays = 0;
        MediumStack* stack = media ? wave.shadow_media + k : nullptr;
        Color through =
            walk_transparent(task.scene, wave.shadow_rays[k], shadow, stack, tracer, shader, points, &steps, &rays);
        add_total(wave, TOTAL_TRANSPARENT_STEPS, steps);
        add_total(wave, TOTAL_TRANSPARENT_RAYS, rays);
        return through;
    }
#endif
    return make_vec3(0.0f);
}

}  // namespace luch

extern "C" __global__ void __launch_bounds__(luch::STAGE_BLOCK, LUCH_STAGE_BLOCKS)
    add_shadows(const __grid_constant__ luch::RenderTask task, const __grid_constant__ luch::SceneTrees trees) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = stage_index();
    if (k >= wave.counters[WAVE_SHADOWS]) return;
    ShadowRay shadow = wave.shadows[k];
    if (plan::TIME && wave.ticks) add_ticks(wave, CLOCK_ANY, shadow.path, wave.shadow_ticks[k]);
    StageTimer timer(wave, CLOCK_SHADOWS, shadow.path);
    PathState path = load_path(wave, shadow.path);
    Color through = shadow_transmittance(task, trees, k, shadow);
    if (is_zero(through)) return;
    FilmWriter writer = film_of_slot(task, shadow.path);
    add_direct(task.scene, writer, path, shadow, through);
    add_totals(wave, writer);
}

// The stages after shadow rays were traced: what reached its light enters the film. Those that met a surface that may let
// light through come together in a stage of their own: among others they would leave most of a warp idle.
#pragma once
#include "luch/integrator/direct_light.h"
#include "render/one_ray.cuh"
#include "render/stage.cuh"

namespace luch {

__device__ __forceinline__ void add_light(const RenderTask& task, const ShadowRay& shadow, Color through) {
    PathState path = load_path(task.wave, shadow.path);
    FilmWriter writer = film_of_slot(task, shadow.path);
    add_direct(task.scene, writer, path, shadow, through);
    add_totals(task.wave, writer);
}

__device__ __forceinline__ void add_shadow(const RenderTask& task, u32 k, const ShadowRay& shadow) {
    const Wavefront& wave = task.wave;
    u8 blocked = shadow.casts ? wave.blocked[k] : u8(BLOCKED_NOT);
#if LUCH_TRANSPARENT
    if (blocked == BLOCKED_MAYBE) {
        wave.see_through[append(wave, WAVE_SEE_THROUGH)] = k;
        return;
    }
#endif
    if (blocked != BLOCKED_NOT) return;
    Color through = make_vec3(1.0f);
    if (plan::VOLUMES && wave.media && shadow.casts)
        through = media_transmittance(task.scene.media, wave.shadow_media[k], wave.shadow_rays[k].t_max);
    if (!is_zero(through)) add_light(task, shadow, through);
}

}  // namespace luch

LUCH_STAGE(add_shadows) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = stage_index();
    if (k >= wave.counters[WAVE_SHADOWS]) return;
    ShadowRay shadow = wave.shadows[k];
    if (plan::TIME && wave.ticks) add_ticks(wave, CLOCK_ANY, shadow.path, wave.shadow_ticks[k]);
    StageTimer timer(wave, CLOCK_SHADOWS, shadow.path);
    add_shadow(task, k, shadow);
}

// Launched where some material lets light through.
extern "C" __global__ void __launch_bounds__(luch::STAGE_BLOCK, LUCH_STAGE_BLOCKS)
    see_through(const __grid_constant__ luch::RenderTask task, const __grid_constant__ luch::SceneTrees trees) {
#if LUCH_TRANSPARENT
    using namespace luch;
    const Wavefront& wave = task.wave;
    if (stage_index() >= wave.counters[WAVE_SEE_THROUGH]) return;
    u32 k = wave.see_through[stage_index()];
    ShadowRay shadow = wave.shadows[k];
    StageTimer timer(wave, CLOCK_SHADOWS, shadow.path);
    ShadePoints points;
    ClosureSet set;
    SurfaceShader shader{task.scene.view, set};
    OneRay tracer{trees, plan::MOTION && wave.shadow_time ? wave.shadow_time[k] : SHUTTER_MIDDLE};
    u64 steps = 0, rays = 0;
    MediumStack* stack = plan::VOLUMES && wave.media ? wave.shadow_media + k : nullptr;
    Color through =
        walk_transparent(task.scene, wave.shadow_rays[k], shadow, stack, tracer, shader, points, &steps, &rays);
    add_total(wave, TOTAL_TRANSPARENT_STEPS, steps);
    add_total(wave, TOTAL_TRANSPARENT_RAYS, rays);
    if (!is_zero(through)) add_light(task, shadow, through);
#endif
}

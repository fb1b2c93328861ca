// The stage after shadow rays were traced: what reached its light enters the film.
#pragma once
#include "luch/accel/two_level.h"
#include "luch/integrator/direct_light.h"
#include "render/stage.cuh"

namespace luch {

using SceneTrees = TwoLevelView<LUCH_STRUCTURE>;

// One ray, for those that look through surfaces one by one.
struct OneRay {
    const SceneTrees& trees;
    __device__ __noinline__ Hit closest(const Ray& ray) {
        return closest_hit<Precision::LUCH_PRECISION>(trees, ray, RAY_SHADOW);
    }
};

__device__ __forceinline__ Color shadow_transmittance(const RenderTask& task, const SceneTrees& trees, u32 k,
                                                      const ShadowRay& shadow) {
    const Wavefront& wave = task.wave;
    if (!shadow.casts || wave.blocked[k] == BLOCKED_NOT) return make_vec3(1.0f);
#if LUCH_TRANSPARENT
    if (wave.blocked[k] == BLOCKED_MAYBE) {
        ShadePoints points;
        ClosureSet set;
        PointShader shader{task.scene.view, set};
        OneRay tracer{trees};
        u64 steps = 0, rays = 0;
        Color through =
            walk_transparent(task.scene, wave.shadow_rays[k], shadow, tracer, shader, points, &steps, &rays);
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
    PathState path = load_path(wave, shadow.path);
    Color through = shadow_transmittance(task, trees, k, shadow);
    if (is_zero(through)) return;
    FilmWriter writer = film_of_slot(task, shadow.path);
    add_direct(task.scene, writer, path, shadow, through);
    add_total(wave, TOTAL_REJECTED, writer.rejected);
}

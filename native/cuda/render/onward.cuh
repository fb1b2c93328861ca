// What happens to a path at any surface: a light for it, and where it goes on.
#pragma once
#include "luch/integrator/direct_light.h"
#include "render/stage.cuh"

namespace luch {

// Emission of a light's program at the sampled place.
__device__ __forceinline__ Color sampled_emission(const RenderTask& task, const PathState& path, u32 slot,
                                                  const LightSample& sample, float footprint) {
    ConstantEmission constant = emission_of(task.scene, sample);
    if (constant.constant) return constant.radiance;
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    setup_light_lane(task.scene, path, slot, sample, footprint, points, 0);
    run_light_program(context_of(task.scene.view, program_of(task.scene, sample), points, set, nullptr));
    add_total(task.wave, TOTAL_LIGHT_POINTS, 1);
    return set.emission;
}

__device__ __forceinline__ void push_shadow(const Wavefront& wave, const Ray& ray, const ShadowRay& shadow) {
    u32 at = append(wave, WAVE_SHADOWS);
    wave.shadow_rays[at] = ray;
    wave.shadows[at] = shadow;
}

__device__ __noinline__ void light_surface(const RenderTask& task, const PathState& path, u32 slot,
                                           const ShadePoints& points, const ClosureSet& set,
                                           const SurfacePoint& spawn) {
    LightSample sample;
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_LIGHT);
    if (!choose_light(task.scene, path, points, 0, set, u, &sample)) return;
    Color emission = sampled_emission(task, path, slot, sample, points.footprint[0]);
    Ray ray;
    ShadowRay shadow;
    if (make_shadow_ray(task.film.layout, path, slot, points, 0, set, spawn, sample, emission, &ray, &shadow))
        push_shadow(task.wave, ray, shadow);
}

// The path's next ray, if it goes on.
__device__ __noinline__ void send_on(const RenderTask& task, PathState& path, u32 slot, const ShadePoints& points,
                                     const ClosureSet& set, const SurfacePoint& spawn, Vec3 direction, float distance) {
    const Wavefront& wave = task.wave;
    Ray next;
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_BSDF);
    u64 rejected = 0;
    bool goes_on =
        scatter(task.scene, task.film.layout, path, points, 0, set, spawn, u, direction, distance, &next, &rejected);
    add_total(wave, TOTAL_REJECTED, rejected);
    if (!goes_on) return;
    u32 at = append(wave, WAVE_NEXT_RAYS);
    wave.next_rays[at] = next;
    wave.next_slot[at] = slot;
    wave.next_kind[at] = path.visibility;
}

}  // namespace luch

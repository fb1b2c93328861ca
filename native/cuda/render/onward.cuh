// What happens to a path at any surface: a light for it, and where it goes on.
#pragma once
#include "luch/integrator/volume.h"
#include "render/stage.cuh"

namespace luch {

// The media of a path, and those that a ray leaving its surface in a direction meets; nothing without media.
__device__ __forceinline__ const MediumStack* media_of(const Wavefront& wave, u32 slot) {
    return plan::VOLUMES && wave.media ? wave.media + slot : nullptr;
}
__device__ __forceinline__ MediumStack beyond(const RenderTask& task, u32 slot, const ShadePoints& points,
                                              Vec3 direction) {
    return media_towards(task.scene, task.wave.media[slot], points, 0, direction);
}

// Emission of a light's program at the sampled place.
__device__ __forceinline__ Color sampled_emission(const RenderTask& task, const PathState& path, u32 slot,
                                                  const LightSample& sample, float footprint, float time) {
    ConstantEmission constant = emission_of(task.scene, sample, time);
    if (!plan::SAMPLED_PROGRAMS || constant.constant) return constant.radiance;
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    setup_light_lane(task.scene, path, slot, sample, footprint, time, points, 0);
    run_light_program(context_of(task.scene.view, program_of(task.scene, sample), points, set, nullptr));
    add_total(task.wave, TOTAL_LIGHT_POINTS, 1);
    return set.emission;
}

__device__ __forceinline__ void push_shadow(const RenderTask& task, u32 slot, const ShadePoints& points, const Ray& ray,
                                            const ShadowRay& shadow) {
    MediumStack media;
    if (plan::VOLUMES && task.wave.media) media = beyond(task, slot, points, ray.direction);
    push_shadow(task.wave, ray, lane_time(points, 0), shadow, plan::VOLUMES && task.wave.media ? &media : nullptr);
}

__device__ __forceinline__ void light_surface(const RenderTask& task, const PathState& path, u32 slot,
                                              const ShadePoints& points, const ClosureSet& set,
                                              const SurfacePoint& spawn) {
    LightSample sample;
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_LIGHT);
    if (!choose_light(task.scene, path, points, 0, set, u, &sample)) return;
    Color emission = sampled_emission(task, path, slot, sample, points.footprint[0], lane_time(points, 0));
    Ray ray;
    ShadowRay shadow;
    if (make_shadow_ray(task.scene, task.film.layout, path, slot, points, 0, set, spawn, sample, emission, &ray,
                        &shadow))
        push_shadow(task, slot, points, ray, shadow);
}

// The path's next ray, if it goes on.
__device__ __forceinline__ void send_on(const RenderTask& task, PathState& path, u32 slot, const ShadePoints& points,
                                        const ClosureSet& set, const SurfacePoint& spawn, Vec3 direction,
                                        float distance) {
    const Wavefront& wave = task.wave;
    Ray next;
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_BSDF);
    FilmWriter writer{task.film, task.wave.totals + TOTAL_REFUSED};
    bool goes_on = scatter(task.scene, writer, path, points, 0, set, spawn, u, direction, distance, &next);
    add_totals(wave, writer);
    if (!goes_on) return;
    if (plan::VOLUMES && wave.media) wave.media[slot] = beyond(task, slot, points, next.direction);
    push_ray(wave, next, lane_time(points, 0), slot, path.visibility);
}

}  // namespace luch

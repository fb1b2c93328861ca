// The stage at a surface: its program, its emission, what it tells the film, a light for it, and where the path goes.
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

// entry: of the sorted queue. True when the surface was shaded.
__device__ __forceinline__ bool shade_entry(const RenderTask& task, u32 entry) {
    const Wavefront& wave = task.wave;
    const RenderView& scene = task.scene;
    u32 k = wave.sorted[entry], slot = wave.ray_slot[k];
    Hit hit = wave.hits[k];
    Ray ray = wave.rays[k];
    u32 material_index = material_at(scene.view, hit.instance, hit.prim);
    const MaterialView& material = scene.view.materials[material_index];
    PathState path = load_path(wave, slot);
    if (!survives(scene, path, material)) return false;
    FilmWriter writer = film_of_slot(task, slot);
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    SurfacePoint spawn = surface_point(scene.view, hit, ray);
    setup_surface_lane(scene.view, surface_inputs(path, slot, hit, spawn, ray.direction), points, 0);
    u32 aov_floats = 4u * task.film.layout.aov_count;
    float* aovs = wave.aovs ? wave.aovs + u64(entry) * aov_floats : nullptr;
    for (u32 i = 0; aovs && i < aov_floats; ++i) aovs[i] = 0.0f;
    run_program(context_of(scene.view, material.program, points, set, aovs));
    if (meet_surface(scene, writer, path, points, 0, set, material_index, aovs)) {
        if (scene.has_lights) light_surface(task, path, slot, points, set, spawn);
        if (wants_ao(task.film.layout, path)) {
            Ray ao_ray;
            ShadowRay ao;
            make_ao_ray(scene, path, slot, points, 0, set, spawn, &ao_ray, &ao);
            push_shadow(wave, ao_ray, ao);
        }
        send_on(task, path, slot, points, set, spawn, ray.direction, hit.t);
        store_path(wave, slot, path);
    }
    add_total(wave, TOTAL_REJECTED, writer.rejected);
    return true;
}

}  // namespace luch

LUCH_STAGE(shade_surfaces) {
    using namespace luch;
    u32 entry = stage_index();
    bool shaded = entry < task.wave.counters[WAVE_HITS] && shade_entry(task, entry);
    u32 count = u32(__syncthreads_count(shaded));
    if (threadIdx.x == 0) add_total(task.wave, TOTAL_SURFACE_POINTS, count);
}

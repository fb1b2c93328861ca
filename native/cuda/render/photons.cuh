// The stages of photons: starting them, following them over sharp surfaces, and sorting them into a map.
#pragma once
#include "luch/integrator/photon.h"
#include "render/onward.cuh"

namespace luch {

struct PhotonEmission {
    const RenderTask& task;
    u32 slot;
    __device__ __forceinline__ Color operator()(const LightSample& sample, const PathState& path, float time) const {
        return sampled_emission(task, path, slot, sample, 0.0f, time);
    }
};

__device__ __forceinline__ void start_photon(const RenderTask& task, const PhotonRange& range, u32 slot) {
    const Wavefront& wave = task.wave;
    PathState path;
    Ray ray;
    float time;
    PhotonEmission emission{task, slot};
    if (!begin_photon(task.scene, range.map, range.first + slot, emission, path, &ray, &time)) return;
    u32 k = append(wave, WAVE_RAYS);
    wave.rays[k] = ray;
    if (plan::MOTION && wave.ray_time) wave.ray_time[k] = time;
    wave.ray_slot[k] = slot;
    wave.ray_kind[k] = path.visibility;
    store_path(wave, slot, path);
}

__device__ __forceinline__ void photon_entry(const RenderTask& task, u32 entry) {
    const Wavefront& wave = task.wave;
    const RenderView& scene = task.scene;
    u32 k = wave.sorted[entry], slot = wave.ray_slot[k];
    Hit hit = wave.hits[k];
    Ray ray = wave.rays[k];
    PathState path = load_path(wave, slot);
    ShadePoints points;
    ClosureSet set;
    points.count = 1;
    float time = time_of_ray(wave, k);
    SurfacePoint spawn = setup_hit_lane(scene, path, slot, hit, ray, time, points, 0);
    const MaterialView& material = scene.view.materials[material_at(scene.view, hit.instance, hit.prim)];
    run_program(context_of(scene.view, material.program, points, set, nullptr));
    Ray next;
    Photon photon;
    bool lands;
    bool goes_on = photon_at_surface(scene, wave.totals + TOTAL_REFUSED, path, points, 0, set, spawn, ray.direction,
                                     hit.t, &next, &photon, &lands);
    if (lands) {
        u32 at = append_to(in_global(wave.landed_count));
        if (at < wave.landed_room) wave.landed[at] = photon;
    }
    if (!goes_on) return;
    store_path(wave, slot, path);
    push_ray(wave, next, time, slot, path.visibility);
}

}  // namespace luch

#if LUCH_PLAN_PHOTONS
extern "C" __global__ void __launch_bounds__(luch::STAGE_BLOCK, LUCH_STAGE_BLOCKS)
    begin_photons(const __grid_constant__ luch::RenderTask task, const luch::PhotonRange range) {
    using namespace luch;
    u32 slot = stage_index();
    if (slot < range.count) start_photon(task, range, slot);
}

LUCH_STAGE(shade_photons) {
    using namespace luch;
    u32 entry = stage_index();
    if (entry < task.wave.counters[WAVE_HITS]) photon_entry(task, entry);
}
#endif

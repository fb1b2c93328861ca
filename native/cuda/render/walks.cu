// Under surfaces: walks, whose threads take the next as they end one, since some take hundreds of steps; and probes. No
// shader program runs.
#ifndef LUCH_PLAN_MOTION
#define LUCH_PLAN_MOTION 0  // as in trace.cuh
#endif
#ifndef LUCH_PLAN_TIME
#define LUCH_PLAN_TIME 0
#endif
#include "luch/accel/local_trees.h"
#include "luch/integrator/wavefront.h"

#include "luch/integrator/subsurface_disk.h"
#include "render/clock.cuh"

namespace luch {

inline constexpr int WALK_BLOCK = 128;  // threads; luch/cuda/render.py launches as many
inline constexpr int WALK_RESIDENT = 4;  // blocks a multiprocessor holds: 128 registers a thread

struct LocalTracer {
    const LocalTreesView& trees;
    float time;  // of the walk
    __device__ __forceinline__ Hit closest(u32 instance, const Ray& ray) const {
        return closest_hit<Precision::LUCH_PRECISION>(trees, instance, ray, time);
    }
};

__device__ __forceinline__ void store_end(SubsurfaceWalk* to, const SubsurfaceWalk& walk, WalkFate fate) {
    to->position = walk.position;
    to->direction = walk.direction;
    to->throughput = walk.throughput;
    to->hit = walk.hit;
    if (fate == WalkFate::LOST) to->hit.instance = NONE;
}

}  // namespace luch

extern "C" __global__ void __launch_bounds__(luch::WALK_BLOCK, luch::WALK_RESIDENT)
    walk_subsurface(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 count = wave.counters[WAVE_WALKS], at = 0;
    u64 steps = 0;
    LocalTracer tracer{*task.scene.local_trees, SHUTTER_MIDDLE};
    SubsurfaceWalk walk;
    WalkPlan way;
    WalkFate fate = WalkFate::LOST;
    bool walking = false;
    long long began = 0;
    for (;;) {
        if (!walking) {
            at = atomicAdd(wave.counters + WAVE_WALKED, 1u);
            if (at >= count) break;
            if (wave.walks[at].probe) continue;
            walk = wave.walks[at];
            tracer.time = time_of_ray(wave, walk.ray);
            way = begin_walk(walk);
            walking = true;
            if constexpr (plan::TIME) began = clock64();
        }
        fate = take_step(walk, way, tracer);
        ++steps;
        walking = fate == WalkFate::GOES_ON;
        if (walking) continue;
        store_end(wave.walks + at, walk, fate);
        if (plan::TIME && wave.ticks)
            add_ticks(wave, CLOCK_WALKS, wave.ray_slot[walk.ray], static_cast<u32>(clock64() - began));
    }
    if (steps != 0) atomicAdd(wave.totals + TOTAL_WALK_STEPS, steps);
}

// Those that probe a profile instead: one thread each.
extern "C" __global__ void __launch_bounds__(luch::WALK_BLOCK)
    probe_profiles(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k >= wave.counters[WAVE_WALKS] || !wave.walks[k].probe) return;
    SubsurfaceWalk walk = wave.walks[k];
    StageTimer timer(wave, CLOCK_WALKS, wave.ray_slot[walk.ray]);
    LocalTracer tracer{*task.scene.local_trees, time_of_ray(wave, walk.ray)};
    u64 rays = 0;
    probe_disk(task.scene.view, walk, tracer, &rays);
    store_end(wave.walks + k, walk, WalkFate::LEAVES);
    atomicAdd(wave.totals + TOTAL_WALK_STEPS, rays);
}

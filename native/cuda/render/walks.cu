// Walks under surfaces: threads that end one take the next, since some take hundreds of steps. No shader program runs.
#include "luch/accel/local_trees.h"
#include "luch/integrator/wavefront.h"

#include "luch/integrator/subsurface_disk.h"

namespace luch {

inline constexpr int WALK_BLOCK = 128;  // threads; luch/cuda/render.py launches as many

struct LocalTracer {
    const LocalTreesView& trees;
    __device__ __forceinline__ Hit closest(u32 instance, const Ray& ray) const {
        return closest_hit<Precision::LUCH_PRECISION>(trees, instance, ray);
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

extern "C" __global__ void __launch_bounds__(luch::WALK_BLOCK)
    walk_subsurface(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 count = wave.counters[WAVE_WALKS], at = 0;
    u64 steps = 0;
    LocalTracer tracer{*task.scene.local_trees};
    SubsurfaceWalk walk;
    WalkPlan plan;
    WalkFate fate = WalkFate::LOST;
    bool walking = false;
    for (;;) {
        if (!walking) {
            at = atomicAdd(wave.counters + WAVE_WALKED, 1u);
            if (at >= count) break;
            walk = wave.walks[at];
            if (walk.probe) {
                probe_disk(task.scene.view, walk, tracer, &steps);
                store_end(wave.walks + at, walk, WalkFate::LEAVES);
                continue;
            }
            plan = begin_walk(walk);
            walking = true;
        }
        fate = take_step(walk, plan, tracer);
        ++steps;
        walking = fate == WalkFate::GOES_ON;
        if (!walking) store_end(wave.walks + at, walk, fate);
    }
    if (steps != 0) atomicAdd(wave.totals + TOTAL_WALK_STEPS, steps);
}

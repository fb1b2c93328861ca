// One thread a ray through any structure, by the functions that the CPU runs: templates for kernels.
#pragma once
#include "rays/batch.cuh"

namespace luch {

inline constexpr int RAY_BLOCK = 128;  // threads; luch/cuda/structures.py launches as many

template <class View, Precision P, class Count>
__device__ __forceinline__ void trace_closest(const View& view, const Primitives& all, const RayBatch& batch) {
    u32 i = thread_index();
    if (i >= batch.count) return;
    Ray ray;
    bool valid = load_ray(batch, i, &ray);
    RefHit best = no_hit(ray);
    Count kept;
    if (valid) closest_hit<P>(view, all, ray, &best, kept);
    store_hit(batch, i, best);
    add_counters(batch, kept);
}

template <class View, Precision P, class Count>
__device__ __forceinline__ void trace_any(const View& view, const Primitives& all, const RayBatch& batch) {
    u32 i = thread_index();
    if (i >= batch.count) return;
    Ray ray;
    Count kept;
    batch.blocked[i] = load_ray(batch, i, &ray) ? any_hit<P>(view, all, ray, kept) : u8(BLOCKED_NOT);
    add_counters(batch, kept);
}

}  // namespace luch

// LUCH_RESIDENT_BLOCKS: so many must fit on a multiprocessor at once, and ptxas spills a register rather than have fewer.
#ifdef LUCH_RESIDENT_BLOCKS
#define LUCH_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK, LUCH_RESIDENT_BLOCKS) name
#else
#define LUCH_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK) name
#endif
#define LUCH_ARGUMENTS const LUCH_VIEW view, const luch::Primitives all, const luch::RayBatch batch

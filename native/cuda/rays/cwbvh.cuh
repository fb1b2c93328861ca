// The kernels of the compressed wide tree: persistent ones, and those of any structure under other names.
#pragma once
#include "rays/persistent.cuh"

namespace luch {

// A batch through one tree.
struct TreeRays {
    const Cwbvh& tree;
    const RayBatch& batch;
};
__device__ __forceinline__ const Cwbvh& tree_of(const TreeRays& rays) { return rays.tree; }
__device__ __forceinline__ CurveSet curves_in(const TreeRays&) { return {}; }
__device__ __forceinline__ u32 ray_count(const TreeRays& rays) { return rays.batch.count; }
__device__ __forceinline__ u32* next_ray(const TreeRays& rays) { return rays.batch.next; }
__device__ __forceinline__ bool load_ray(const TreeRays& rays, u32 i, Ray* ray) { return load_ray(rays.batch, i, ray); }
__device__ __forceinline__ void store_hit(const TreeRays& rays, u32 i, const RefHit& hit) {
    store_hit(rays.batch, i, hit);
}
__device__ __forceinline__ void store_blocked(const TreeRays& rays, u32 i, u8 blocked) {
    rays.batch.blocked[i] = blocked;
}

}  // namespace luch

#define LUCH_PERSISTENT_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK, LUCH_BLOCKS) name

LUCH_PERSISTENT_KERNEL(closest)(LUCH_ARGUMENTS) {
    luch::trace_persistent<luch::Walker<luch::Precision::LUCH_PRECISION, false>>(luch::TreeRays{view, batch});
}
LUCH_PERSISTENT_KERNEL(any)(LUCH_ARGUMENTS) {
    luch::trace_persistent<luch::Walker<luch::Precision::LUCH_PRECISION, true>>(luch::TreeRays{view, batch});
}
LUCH_KERNEL(closest_simple)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(any_simple)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(closest_counted)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}
LUCH_KERNEL(any_counted)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}

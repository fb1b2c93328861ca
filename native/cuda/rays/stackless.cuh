// The stackless tree as the lecture walks it on a GPU: the block fetches a window of nodes into shared memory, each ray
// goes through it as far as it comes, then all vote for the lowest address that any of them needs. Nodes stand depth
// first and every step goes forward, so no ray ever needs a node before the window.
#pragma once
#include "luch/accel/bvh2_stackless.h"
#include "rays/block.cuh"
#include "rays/generic.cuh"

namespace luch {

inline constexpr u32 WINDOW = RAY_BLOCK;  // nodes: 4 KB

template <Precision P>
__device__ __forceinline__ void trace_together(const Bvh2Stackless& tree, const Primitives& all,
                                               const RayBatch& batch) {
    __shared__ SkipNode window[WINDOW];
    u32 i = thread_index();
    Ray ray = {{0.0f, 0.0f, 0.0f}, 0.0f, {0.0f, 0.0f, 1.0f}, 0.0f};
    bool valid = i < batch.count && load_ray(batch, i, &ray);
    RefHit best = no_hit(ray);
    NoCounters none;
    ClosestInLeaf<P, NoCounters> leaf = {all, tree.refs, PrimitiveRay<P>(ray), ray.t_min, &best, none};
    const BoxRay box = slab_ray<P>(ray, tree.root);
    u32 at = valid ? 0 : tree.node_count;
    for (;;) {
        u32 first = u32(block_min(at));
        if (first >= tree.node_count) break;
        u32 left = tree.node_count - first, count = left < WINDOW ? left : WINDOW;
        if (threadIdx.x < count) window[threadIdx.x] = tree.nodes[first + threadIdx.x];
        __syncthreads();
        while (at - first < count) {
            const SkipNode& node = window[at - first];
            float enter;
            bool entered = enter_box(box, node.lo, node.hi, ray.t_min, best.t, &enter), inner = node.count == 0;
            at = inner && !entered ? node.link : at + 1;
            if (entered && !inner) leaf(node.link, node.count);
        }
        __syncthreads();
    }
    if (i < batch.count) store_hit(batch, i, best);
}

}  // namespace luch

LUCH_KERNEL(closest_together)(LUCH_ARGUMENTS) {
    luch::trace_together<luch::Precision::LUCH_PRECISION>(view, all, batch);
}

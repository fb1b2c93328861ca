// Brute force in the lecture's three ways to map rays and triangles to threads. The first is `closest` of
// structure.cuh: each thread has its own ray and its own index into the triangles, which all lie in global memory.
// The other two follow. All give the same hit: the smallest t and, on equal t, the smaller ref.
#pragma once
#include "luch/accel/brute_force.h"
#include "rays/block.cuh"
#include "rays/generic.cuh"

namespace luch {

// Primitives that a block has copied to shared memory, triangles first, as refs ascend.
struct Tile {
    float corners[9 * RAY_BLOCK];
    float spheres[4 * RAY_BLOCK];
    u32 refs[RAY_BLOCK];
};

// Every thread of the block calls it, with one primitive each; returns the tile as primitives of its own numbers.
__device__ __forceinline__ Primitives fill_tile(const BruteForce& list, const Primitives& all, u32 first, u32 count,
                                                Tile* tile) {
    u32 k = threadIdx.x;
    bool mine = k < count;
    u32 ref = mine ? list.refs[first + k] : NONE;
    bool is_triangle = mine && ref < all.triangle_count;
    u32 triangles = u32(__syncthreads_count(is_triangle));  // also: nobody reads the last tile any more
    tile->refs[k] = ref;
    if (is_triangle)
        for (int c = 0; c < 9; ++c) tile->corners[9 * k + c] = all.corners[9 * u64(ref) + c];
    else if (mine)
        for (int c = 0; c < 4; ++c)
            tile->spheres[4 * (k - triangles) + c] = all.spheres[4 * u64(ref - all.triangle_count) + c];
    __syncthreads();
    return {tile->corners, tile->spheres, nullptr, triangles, count - triangles, {}};
}

// Own ray, shared triangles: the block walks through all tiles together.
template <Precision P, class Count>
__device__ __forceinline__ void trace_tiles(const BruteForce& list, const Primitives& all, const RayBatch& batch) {
    __shared__ Tile tile;
    u32 i = thread_index();
    Ray ray = {{0.0f, 0.0f, 0.0f}, 0.0f, {0.0f, 0.0f, 1.0f}, 0.0f};
    bool valid = i < batch.count && load_ray(batch, i, &ray);
    PrimitiveRay<P> prepared(ray);
    RefHit best = no_hit(ray);
    Count kept;
    for (u32 first = 0; first < list.count; first += RAY_BLOCK) {
        u32 count = list.count - first < u32(RAY_BLOCK) ? list.count - first : u32(RAY_BLOCK);
        Primitives near_by = fill_tile(list, all, first, count, &tile);
        for (u32 k = 0; valid && k < count; ++k) {
            TriangleHit hit;
            if (test_primitive(near_by, prepared, k, ray.t_min, best.t, &hit, kept) &&
                is_closer(hit.t, tile.refs[k], best))
                best = {hit.t, tile.refs[k], hit.u, hit.v};
        }
    }
    if (i >= batch.count) return;
    store_hit(batch, i, best);
    add_counters(batch, kept);
}

// t is positive, so its bits sort as it does; a miss sorts last.
__device__ __forceinline__ u64 sort_key(const RefHit& hit) {
    return hit.ref == NONE ? ~u64(0) : (u64(float_bits(hit.t)) << 32 | hit.ref);
}

// Shared ray, own triangles: one block a ray, then a min-reduction over (t, ref).
template <Precision P, class Count>
__device__ __forceinline__ void trace_reduced(const BruteForce& list, const Primitives& all, const RayBatch& batch) {
    u32 i = blockIdx.x;
    Ray ray;
    bool valid = load_ray(batch, i, &ray);
    PrimitiveRay<P> prepared(ray);
    RefHit best = no_hit(ray);
    Count kept;
    for (u32 k = threadIdx.x; valid && k < list.count; k += RAY_BLOCK)
        offer_primitive(all, prepared, list.refs[k], ray.t_min, &best, kept);
    u64 mine = sort_key(best), least = block_min(mine);
    bool nobody = least == ~u64(0);
    if (nobody ? threadIdx.x == 0 : mine == least) store_hit(batch, i, best);
    add_counters(batch, kept);
}

}  // namespace luch

LUCH_KERNEL(closest_tiled)(LUCH_ARGUMENTS) {
    luch::trace_tiles<luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(closest_reduced)(LUCH_ARGUMENTS) {
    luch::trace_reduced<luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}

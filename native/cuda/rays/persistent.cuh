// The compressed wide tree at full speed: warps that stay and fetch new rays when too few of their lanes are busy, the
// first entries of each stack in shared memory, leaves that wait until enough lanes of the warp are at one (Aila,
// Laine 2009; Ylitie, Karras, Laine 2017). What is computed is luch/accel/cwbvh.h's: the same hits in any order.
//
// Rays: a tree, where its rays come from and results go: with tree_of, curves_in, ray_count, next_ray, load_ray, store_hit and
// store_blocked of its own.
#pragma once
#include "rays/structure.cuh"

// What a tuning run may set before this file.
#ifndef LUCH_BLOCKS
#define LUCH_BLOCKS 6  // a multiprocessor: 80 registers a thread
#endif
#ifndef LUCH_SHARED_ENTRIES
#define LUCH_SHARED_ENTRIES 8
#endif
#ifndef LUCH_SPARE_LANES
#define LUCH_SPARE_LANES 4
#endif
#ifndef LUCH_LOST_STEPS
#define LUCH_LOST_STEPS 16
#endif
#ifndef LUCH_TOGETHER
#define LUCH_TOGETHER 1
#endif
#ifndef LUCH_LEAF_SHARE
#define LUCH_LEAF_SHARE 5
#endif
#ifndef LUCH_ODD_ASIDES
#define LUCH_ODD_ASIDES 1
#endif
#ifndef LUCH_MOST_A_FETCH
#define LUCH_MOST_A_FETCH 64
#endif
#ifndef LUCH_FEWEST_A_FETCH
#define LUCH_FEWEST_A_FETCH 8
#endif
#ifndef LUCH_TIMED_RAYS
#define LUCH_TIMED_RAYS 0  // each ray's clock cycles are told, for the Render Time pass
#endif

namespace luch {

inline constexpr u32 ALL_LANES = 0xffffffffu;
inline constexpr u32 SHARED_ENTRIES = LUCH_SHARED_ENTRIES;  // of a stack, in shared memory; the rest is local
// That a warp takes from the batch at once: as many, or fewer where the batch would not feed all warps.
inline constexpr u32 MOST_A_FETCH = LUCH_MOST_A_FETCH, FEWEST_A_FETCH = LUCH_FEWEST_A_FETCH;
inline constexpr u32 SPARE_LANES = LUCH_SPARE_LANES;  // that may be idle at no account
inline constexpr u32 LOST_LANE_STEPS = LUCH_LOST_STEPS;  // then idle lanes get new rays
inline constexpr u32 LEAF_SHARE = LUCH_LEAF_SHARE;  // leaves wait until this part of the busy lanes is at one

// A ray's groups that wait. Postponed leaves stand on it too: two entries a level at most.
struct SplitStack {
    u64 *shared, *local;  // this thread's column; an array of its own
    u32 size;
    __device__ __forceinline__ void push(WaitingGroup group) {
        u64 entry = u64(group.hits) << 32 | group.first;
        if (size < SHARED_ENTRIES)
            shared[size * RAY_BLOCK] = entry;
        else
            local[size - SHARED_ENTRIES] = entry;
        ++size;
    }
    __device__ __forceinline__ WaitingGroup pop() {
        --size;
        u64 entry = size < SHARED_ENTRIES ? shared[size * RAY_BLOCK] : local[size - SHARED_ENTRIES];
        return {u32(entry), u32(entry >> 32)};
    }
};

// Rays that this warp has taken from the batch and not yet given to lanes: the same in all lanes.
struct RayPool {
    u32 first = 0, left = 0, at_once;
    bool exhausted = false;
    __device__ __forceinline__ explicit RayPool(u32 count) {
        u32 warps = gridDim.x * (blockDim.x / 32u), share = (count + warps - 1u) / warps;
        at_once = share > MOST_A_FETCH ? MOST_A_FETCH : share < FEWEST_A_FETCH ? FEWEST_A_FETCH : share;
    }
    // Each lane that asks gets a ray's index, or NONE.
    template <class Rays>
    __device__ __forceinline__ u32 give(const Rays& rays, bool asks) {
        u32 lane = threadIdx.x % 32u, asking = __ballot_sync(ALL_LANES, asks);
        if (left == 0 && !exhausted) {
            u32 taken = 0;
            if (lane == 0) taken = atomicAdd(next_ray(rays), at_once);
            first = __shfl_sync(ALL_LANES, taken, 0);
            u32 count = ray_count(rays);
            left = first >= count ? 0u : count - first < at_once ? count - first : at_once;
            exhausted = left == 0;
        }
        u32 rank = u32(__popc(asking & ((1u << lane) - 1u))), index = NONE;
        if (asks && rank < left) index = first + rank;
        u32 given = u32(__popc(asking)) < left ? u32(__popc(asking)) : left;
        first += given;
        left -= given;
        return index;
    }
};

template <class T>
__device__ __forceinline__ T load_quads(const T* from) {  // 16 bytes at a time, through the read-only cache
    static_assert(sizeof(T) % 16 == 0 && alignof(T) == 16);
    T out;
    for (u32 k = 0; k < sizeof(T) / 16; ++k)
        reinterpret_cast<uint4*>(&out)[k] = __ldg(reinterpret_cast<const uint4*>(from) + k);
    return out;
}

// What a lane needs at leaves and at the end alone: in shared memory, so that registers are left for boxes. Each lane
// has its own and nobody reads another's, so no barrier stands between writing and reading, here and in the stacks'
// columns. (A test runs the kernel with these arrays private to every thread: the same hits.)
#if LUCH_TIMED_RAYS
struct RayClock {
    long long began;
    __device__ __forceinline__ void start() { began = clock64(); }
    template <class Rays>
    __device__ __forceinline__ void stop(const Rays& rays, u32 index, bool goes_on = false) const {
        u32 before = goes_on ? rays.task.ticks[index] : 0u;
        rays.task.ticks[index] = before + static_cast<u32>(clock64() - began);
    }
};
#else
struct RayClock {
    __device__ __forceinline__ void start() {}
    template <class Rays>
    __device__ __forceinline__ void stop(const Rays&, u32, bool = false) const {}
};
#endif
template <Precision P>
struct Aside : RayClock {
    PrimitiveRay<P> tested;
    RefHit best;
    float t_min;
    u32 index;
};
// Asides lie an odd number of 8-byte words apart: lanes that read the same member then meet in no bank. At 96 bytes,
// without the odd word, eight lanes would meet in each.
template <class Kept>
inline constexpr u32 ASIDE_WORDS = u32(sizeof(Kept) / sizeof(u64)) | u32(LUCH_ODD_ASIDES);

// One lane's ray on its way.
template <Precision P, bool ANY>
struct Walker {
    using Kept = Aside<P>;
    Kept* aside;
    WideRay wide;
    float last;
    WaitingGroup group;
    u8 blocked;
    bool busy;

    // Takes the ray with that index, or answers it at once.
    template <class Rays>
    __device__ __forceinline__ void begin(const Rays& rays, u32 i, SplitStack* stack) {
        const Cwbvh& tree = tree_of(rays);
        Ray ray;
        aside->start();
        busy = load_ray(rays, i, &ray) && tree.node_count != 0;
        aside->index = i;
        aside->best = no_hit(ray);
        blocked = BLOCKED_NOT;
        if (!busy) return finish(rays);
        aside->tested = PrimitiveRay<P>(ray);
        aside->t_min = ray.t_min;
        wide = make_wide_ray(ray, tree.root);
        last = wide.upper(ray.t_max);
        group = {0, 0x80000000u};
        stack->size = 0;
    }
    template <class Rays>
    __device__ __forceinline__ void finish(const Rays& rays) {
        busy = false;
        aside->stop(rays, aside->index);
        if constexpr (ANY)
            store_blocked(rays, aside->index, blocked);
        else
            store_hit(rays, aside->index, aside->best);
    }
    // Visits the next child of the group, or takes its primitives; returns those that the ray may hit.
    template <class Rays>
    __device__ __forceinline__ WaitingGroup visit(const Rays& rays, SplitStack* stack) {
        if (!has_nodes(group)) {
            WaitingGroup leaves = group;
            group.hits = 0;
            return leaves;
        }
        u32 bit = u32(highest_bit(group.hits)), place = (bit - 24u) ^ (7u - wide.octant);
        u32 child = group.first + u32(popcount(group.hits & 0xffu & ~(~0u << place)));
        group.hits &= ~(1u << bit);
        if (has_nodes(group)) stack->push(group);
        const CwbvhNode node = load_quads(tree_of(rays).nodes + child);
        u32 hits = intersect_children(node, wide, last);
        group = {node.first_child, (hits & 0xff000000u) | node.exponents >> 24};
        return {node.first_leaf, hits & 0x00ffffffu};
    }
    // Tests one of the primitives; true when nothing else can matter.
    template <class Rays>
    __device__ __forceinline__ bool test(const Rays& rays, WaitingGroup* leaves) {
        u32 bit = u32(highest_bit(leaves->hits));
        leaves->hits &= ~(1u << bit);
        const LeafPrimitive p = load_quads(tree_of(rays).leaves + leaves->first + bit);
        NoCounters none;
        TriangleHit hit;
        RefHit best = aside->best;
        if (!test_leaf(p, curves_in(rays), aside->tested, aside->t_min, best.t, &hit, none)) return false;
        if constexpr (ANY) {
            bool maybe = p.flags & PRIMITIVE_MAY_BE_TRANSPARENT;
            blocked = maybe ? u8(BLOCKED_MAYBE) : u8(BLOCKED_OPAQUE);
            return !maybe;
        }
        if (!is_closer(hit.t, p.ref, best)) return false;
        aside->best = {hit.t, p.ref, hit.u, hit.v};
        last = wide.upper(hit.t);
        return false;
    }
    // When the group has no more nodes.
    template <class Rays>
    __device__ __forceinline__ void take_waiting(const Rays& rays, SplitStack* stack) {
        if (stack->size == 0)
            finish(rays);
        else
            group = stack->pop();
    }
};

// Whether all lanes have just begun rays that go nearly the same way (within 11 degrees of the first lane's): they will
// meet the same nodes, and neither waiting leaves nor new rays on the way pay.
__device__ __forceinline__ bool go_together(Vec3 direction, bool fresh) {
    Vec3 first = {__shfl_sync(ALL_LANES, direction.x, 0), __shfl_sync(ALL_LANES, direction.y, 0),
                  __shfl_sync(ALL_LANES, direction.z, 0)};
    float along = dot(direction, first);
    bool same = along > 0.0f && along * along >= 0.96f * dot(direction, direction) * dot(first, first);  // NaN: no
    return LUCH_TOGETHER != 0 && __ballot_sync(ALL_LANES, fresh && same) == ALL_LANES;
}

// All lanes call it with theirs: tests them together, or puts them on the stacks while few lanes have any.
template <class Walk, class Rays>
__device__ __forceinline__ void test_leaves(const Rays& rays, Walk& walker, SplitStack* stack, WaitingGroup leaves,
                                            bool together) {
    u32 busy = u32(__popc(__ballot_sync(ALL_LANES, walker.busy)));
    for (;;) {
        u32 at_leaf = u32(__popc(__ballot_sync(ALL_LANES, leaves.hits != 0)));
        if (at_leaf == 0) return;
        if (!together && at_leaf * LEAF_SHARE < busy) {
            if (leaves.hits != 0) stack->push(leaves);
            return;
        }
        if (leaves.hits != 0 && walker.test(rays, &leaves)) {
            walker.finish(rays);
            leaves.hits = walker.group.hits = 0;
        }
    }
}

// Walk: Walker, or one that does as it does.
template <class Walk, class Rays>
__device__ __forceinline__ void trace_persistent(const Rays& rays) {
    using Kept = typename Walk::Kept;
    __shared__ u64 columns[SHARED_ENTRIES * RAY_BLOCK];
    __shared__ u64 asides[RAY_BLOCK * ASIDE_WORDS<Kept>];
    static_assert(sizeof(Kept) % sizeof(u64) == 0);
    u64 local[2 * CWBVH_MAX_DEPTH - SHARED_ENTRIES];
    SplitStack stack = {columns + threadIdx.x, local, 0};
    Walk walker;
    walker.aside = reinterpret_cast<Kept*>(asides + threadIdx.x * ASIDE_WORDS<Kept>);
    walker.busy = false;
    RayPool pool(ray_count(rays));
    for (;;) {
        u32 index = pool.give(rays, !walker.busy);
        if (index != NONE) walker.begin(rays, index, &stack);
        bool together = go_together(walker.aside->tested.direction, index != NONE && walker.busy);
        u32 lost = 0;
        for (;;) {
            u32 idle = 32u - u32(__popc(__ballot_sync(ALL_LANES, walker.busy)));
            if (idle == 32u) break;
            lost += idle > SPARE_LANES ? idle - SPARE_LANES : 0u;
            if (lost > LOST_LANE_STEPS && !together && !pool.exhausted) break;
            WaitingGroup leaves = {0, 0};
            if (walker.busy) leaves = walker.visit(rays, &stack);
            test_leaves(rays, walker, &stack, leaves, together);
            if (!walker.busy || has_nodes(walker.group)) continue;
            walker.take_waiting(rays, &stack);
        }
        if (pool.exhausted && !__ballot_sync(ALL_LANES, walker.busy)) return;
    }
}

}  // namespace luch

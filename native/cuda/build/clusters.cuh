// The binary tree of sorted primitives: neighbours are merged bottom up where the space curve's own tree joins their
// ranges (Benthin et al. 2024, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering"). A range of at most half a
// warp waits unmerged; a larger one is merged by a whole warp down to half a warp's clusters.
#pragma once
#include "build/task.cuh"

namespace luch {

inline constexpr u32 HALF_WARP = 16;
inline constexpr u32 SEARCH_RADIUS = 8;

struct Cluster {
    u32 id;  // NONE: none
    Box box;
};

__device__ __forceinline__ float half_area(const Box& box) {
    Vec3 e = box.hi - box.lo;
    return e.x * e.y + e.y * e.z + e.z * e.x;
}
__device__ __forceinline__ Vec3 shuffle(Vec3 v, u32 lane) {
    return {__shfl_sync(ALL_LANES, v.x, int(lane)), __shfl_sync(ALL_LANES, v.y, int(lane)),
            __shfl_sync(ALL_LANES, v.z, int(lane))};
}
__device__ __forceinline__ Box shuffle(const Box& box, u32 lane) {
    return {shuffle(box.lo, lane), shuffle(box.hi, lane)};
}

// Two clusters in order of how well they go together: a total order, so that the best pair of a warp is mutual. Among
// equal areas neighbours at even places come first: identical boxes then make a balanced tree.
struct Pair {
    float area;
    u32 low, high;
    __device__ __forceinline__ u32 rank() const { return (high - low) << 6 | (low & 1u) << 5 | low >> 1; }
    __device__ __forceinline__ bool better(const Pair& b) const {
        return area < b.area || (area == b.area && rank() < b.rank());
    }
};

// The lane that mine goes best with, among SEARCH_RADIUS on both sides.
__device__ __forceinline__ u32 best_partner(const Cluster& mine, u32 lane, u32 count) {
    Pair best = {INFINITE_DISTANCE, 0u, 63u};  // worse than any
    for (u32 step = 1; step <= SEARCH_RADIUS; ++step) {
        Box both = shuffle(mine.box, (lane + step) & 31u);
        extend(both, mine.box);
        float area = half_area(both), below = __shfl_sync(ALL_LANES, area, int((lane - step) & 31u));
        Pair above_me = {area, lane, lane + step}, below_me = {below, lane - step, lane};
        if (lane + step < count && above_me.better(best)) best = above_me;
        if (lane >= step && lane < count && below_me.better(best)) best = below_me;
    }
    return best.high == 63u ? NONE : (best.low == lane ? best.high : best.low);
}

// Merges all mutual pairs of the warp's clusters, lanes 0 to count - 1; returns how many are left, in the first lanes.
__device__ __forceinline__ u32 merge_once(const BuildTask& task, Cluster* mine, u32 count, Cluster* room) {
    u32 lane = threadIdx.x % 32u, partner = best_partner(*mine, lane, count);
    u32 ask = partner == NONE ? lane : partner;
    u32 answer = __shfl_sync(ALL_LANES, partner, int(ask));
    Box other_box = shuffle(mine->box, ask);
    u32 other = __shfl_sync(ALL_LANES, mine->id, int(ask));
    bool mutual = lane < count && partner != NONE && answer == lane;
    if (mutual && lane < partner) {
        u32 id = atomicAdd(task.counters + BINARY_NODES, 1u);
        extend(mine->box, other_box);
        task.sizes[id] = __ldcg(task.sizes + mine->id) + __ldcg(task.sizes + other);
        task.nodes[id] = {{mine->box.lo.x, mine->box.lo.y, mine->box.lo.z},
                          mine->id,
                          {mine->box.hi.x, mine->box.hi.y, mine->box.hi.z},
                          other};
        mine->id = id;
    }
    bool stays = lane < count && !(mutual && lane > partner);
    u32 staying = __ballot_sync(ALL_LANES, stays);
    if (stays) room[__popc(staying & ((1u << lane) - 1u))] = *mine;
    __syncwarp();
    u32 left = u32(__popc(staying));
    if (lane < left) *mine = room[lane];
    __syncwarp();
    return left;
}

__device__ __forceinline__ Cluster load_cluster(const BuildTask& task, u32 place) {
    Cluster out = {__ldcg(task.clusters + place), empty_box()};
    if (out.id == NONE) return out;
    const BuildNode* node = task.nodes + out.id;
    out.box.lo = {__ldcg(node->lo), __ldcg(node->lo + 1), __ldcg(node->lo + 2)};
    out.box.hi = {__ldcg(node->hi), __ldcg(node->hi + 1), __ldcg(node->hi + 2)};
    return out;
}

// The whole warp joins the clusters of [first, split) and [split, last].
__device__ __forceinline__ void merge_range(const BuildTask& task, u32 first, u32 split, u32 last, bool whole,
                                            Cluster* room) {
    u32 lane = threadIdx.x % 32u;
    Cluster mine = {NONE, empty_box()};
    if (lane < HALF_WARP && first + lane < split) mine = load_cluster(task, first + lane);
    u32 left = u32(__popc(__ballot_sync(ALL_LANES, mine.id != NONE)));
    if (lane >= left && lane - left < HALF_WARP && split + (lane - left) <= last)
        mine = load_cluster(task, split + (lane - left));
    u32 count = u32(__popc(__ballot_sync(ALL_LANES, mine.id != NONE)));
    while (count > (whole ? 1u : HALF_WARP)) count = merge_once(task, &mine, count, room);
    if (lane < HALF_WARP && first + lane <= last) task.clusters[first + lane] = lane < count ? mine.id : NONE;
    if (whole && lane == 0) task.counters[ROOT] = mine.id;
    __threadfence();
}

// How different neighbours i and i + 1 are: keys first, then places, so that equal keys make a balanced tree.
struct Split {
    u64 keys;
    u32 places, at;
    __device__ __forceinline__ bool nearer(const Split& b) const {
        return keys < b.keys || (keys == b.keys && (places < b.places || (places == b.places && at < b.at)));
    }
};
__device__ __forceinline__ Split split_after(const BuildTask& task, u32 i) {
    return {task.keys[i] ^ task.keys[i + 1], i ^ (i + 1), i};
}

__device__ __forceinline__ void merge_clusters(const BuildTask& task) {
    __shared__ Cluster rooms[BUILD_BLOCK];
    Cluster* room = rooms + threadIdx.x / 32u * 32u;
    u32 i = blockIdx.x * blockDim.x + threadIdx.x, n = task.count;
    u32 first = i, last = i, split = 0;
    bool active = i < n;
    while (__ballot_sync(ALL_LANES, active) != 0) {
        if (active) {  // the second of two ranges that meet at a split goes on with both
            bool to_right =
                first == 0 || (last != n - 1 && split_after(task, last).nearer(split_after(task, first - 1)));
            u32 before = atomicExch(task.arrived + (to_right ? last : first - 1), to_right ? first : last);
            active = before != NONE;
            __threadfence();
            split = to_right ? last + 1 : first;
            if (active && to_right) last = before;
            if (active && !to_right) first = before;
        }
        bool whole = active && last - first + 1 == n;
        u32 waiting = __ballot_sync(ALL_LANES, active && (last - first + 1 > HALF_WARP || whole));
        for (; waiting != 0; waiting &= waiting - 1) {
            int lane = __ffs(int(waiting)) - 1;
            merge_range(task, __shfl_sync(ALL_LANES, first, lane), __shfl_sync(ALL_LANES, split, lane),
                        __shfl_sync(ALL_LANES, last, lane), __shfl_sync(ALL_LANES, u32(whole), lane) != 0, room);
        }
        if (whole) active = false;
    }
}

}  // namespace luch

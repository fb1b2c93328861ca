// The binary tree's nodes taken together by eight, and their boxes rounded to the node's grid (accel/wide_ray.h).
#pragma once
#include "build/task.cuh"

namespace luch {

__device__ __forceinline__ Box box_of(const BuildNode& node) {
    return {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
}
__device__ __forceinline__ float half_area_of(const BuildNode& node) {
    Vec3 e = box_of(node).hi - box_of(node).lo;
    return e.x * e.y + e.y * e.z + e.z * e.x;
}

// Opens the largest child that has more than a leaf's primitives; when none has, the largest that has more than one.
__device__ __forceinline__ u32 open_children(const BuildTask& task, u32 root, u32* child) {
    u32 count = 2;
    child[0] = task.nodes[root].left;
    child[1] = task.nodes[root].right;
    while (count < 8) {
        u32 best = NONE;
        float largest = -1.0f;
        bool large = false;
        for (u32 c = 0; c < count; ++c) {
            u32 size = task.sizes[child[c]];
            float area = half_area_of(task.nodes[child[c]]);
            bool needs = size > CWBVH_LEAF;
            if (size == 1 || (large && !needs) || (large == needs && !(area > largest))) continue;
            best = c;
            largest = area;
            large = needs;
        }
        if (best == NONE) break;
        const BuildNode opened = task.nodes[child[best]];
        child[best] = opened.left;
        child[count++] = opened.right;
    }
    return count;
}

// Each child's place: towards the corner of its place, the farthest out first.
__device__ __forceinline__ void choose_places(const Box& parent, const Box* child, u32 count, u32* at) {
    u32 placed = 0, taken = 0;
    for (u32 round = 0; round < count; ++round) {
        float best = -INFINITE_DISTANCE;
        u32 best_child = NONE, best_place = 0;
        for (u32 c = 0; c < count; ++c) {
            if (placed >> c & 1u) continue;
            Vec3 off = (child[c].lo * 0.5f - parent.lo * 0.5f) + (child[c].hi * 0.5f - parent.hi * 0.5f);
            for (u32 p = 0; p < 8; ++p) {
                if (taken >> p & 1u) continue;
                float along = (p & 4u ? off.x : -off.x) + (p & 2u ? off.y : -off.y) + (p & 1u ? off.z : -off.z);
                if (best_child != NONE && !(along > best)) continue;
                best = along;
                best_child = c;
                best_place = p;
            }
        }
        placed |= 1u << best_child;
        taken |= 1u << best_place;
        at[best_place] = best_child;
    }
}

// 2^(exponent - 127).
__device__ __forceinline__ double step_of(u32 exponent) {
    return __builtin_bit_cast(double, u64(exponent + 1023u - 127u) << 52);
}

// One axis: the grid's start and step, and every child's planes in it, rounded outwards by PLANE_MARGIN and more.
__device__ __forceinline__ void quantise_axis(float parent_lo, float parent_hi, const float* lo, const float* hi,
                                              u32 count, float* start, u32* exponent, u32* q_lo, u32* q_hi) {
    bool usable = parent_hi - parent_lo <= WIDEST;
    double width = (double(parent_hi) - double(parent_lo)) / double(253);
    int power = int(__builtin_bit_cast(u64, width) >> 52 & 0x7ffu) - 1022;  // width < 2^power
    *exponent = power + 127 < int(SMALLEST_STEP) ? SMALLEST_STEP : u32(power + 127);
    for (bool fits = false; !fits; ++*exponent) {
        double step = step_of(*exponent),
               exact = double(parent_lo) - (double(PLANE_BIAS) + 2 * double(PLANE_MARGIN)) * step;
        *start = float(exact);
        if (double(*start) > exact) *start = next_down(*start);
        fits = true;
        for (u32 c = 0; c < count; ++c) {
            double below = floor((double(lo[c]) - double(*start)) / step - double(PLANE_BIAS) - double(PLANE_MARGIN));
            double above = ceil((double(hi[c]) - double(*start)) / step - double(PLANE_BIAS) + double(PLANE_MARGIN));
            bool inside = below >= 0 && above <= 255;
            fits = fits && (inside || !usable);
            q_lo[c] = inside && usable ? u32(below) : 0u;
            q_hi[c] = inside && usable ? u32(above) : 255u;
        }
    }
    --*exponent;
    if (usable) return;
    *exponent = 127;
    *start = bits_float(0x7fc00000u);  // its children are always entered
}

__device__ __forceinline__ void set_byte(u32* words, u32 place, u32 value) {
    words[place / 4] |= value << (8 * (place % 4));
}

__device__ __forceinline__ void write_leaf(const BuildTask& task, u32 ref, u32 to) {
    const float* p = task.corners + 9 * u64(ref);
    u8 flags = task.flags ? task.flags[ref] : u8(0);
    task.leaves[to] = {{p[0], p[1], p[2]}, ref, {p[3], p[4], p[5]}, 0u, {p[6], p[7], p[8]}, flags};
}

// The primitives below a node of at most CWBVH_LEAF, into the leaves from `to` on.
__device__ __forceinline__ void write_leaves(const BuildTask& task, u32 node, u32 to) {
    u32 waiting[CWBVH_LEAF] = {node}, count = 1;
    while (count > 0) {
        const BuildNode n = task.nodes[waiting[--count]];
        if (n.right == NONE) {
            write_leaf(task, n.left, to++);
            continue;
        }
        waiting[count++] = n.left;
        waiting[count++] = n.right;
    }
}

__device__ __forceinline__ void quantise(const Box& parent, const Box* box, u32 count, const u32* at, CwbvhNode* out) {
    for (int axis = 0; axis < 3; ++axis) {
        float lo[8], hi[8];
        u32 q_lo[8], q_hi[8], exponent;
        for (u32 c = 0; c < count; ++c) {
            lo[c] = box[c].lo[axis];
            hi[c] = box[c].hi[axis];
        }
        quantise_axis(parent.lo[axis], parent.hi[axis], lo, hi, count, &out->grid[axis], &exponent, q_lo, q_hi);
        out->exponents |= exponent << (8 * axis);
        for (u32 place = 0; place < 8; ++place) {
            if (at[place] == NONE) continue;
            set_byte(out->lo[axis], place, q_lo[at[place]]);
            set_byte(out->hi[axis], place, q_hi[at[place]]);
        }
    }
}

// A thread makes one wide node; the items of its inner children go into the next level's list.
__device__ __forceinline__ void collapse(const BuildTask& task) {
    u32 i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= task.count) return;
    u32 root = task.items[2 * i], to = task.items[2 * i + 1];
    u32 child[8], at[8] = {NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE}, count = open_children(task, root, child);
    Box box[8];
    u32 inner = 0, primitives = 0;
    for (u32 c = 0; c < count; ++c) {
        u32 size = task.sizes[child[c]];
        box[c] = box_of(task.nodes[child[c]]);
        inner += size > CWBVH_LEAF;
        primitives += size > CWBVH_LEAF ? 0u : size;
    }
    choose_places(box_of(task.nodes[root]), box, count, at);
    CwbvhNode node = {};
    node.first_child = atomicAdd(task.counters + WIDE_NODES, inner);
    node.first_leaf = atomicAdd(task.counters + LEAVES, primitives);
    u32 item = atomicAdd(task.counters + ITEMS, inner), next_child = node.first_child, next_leaf = 0;
    for (u32 place = 0; place < 8; ++place) {
        if (at[place] == NONE) continue;
        u32 below = child[at[place]], size = task.sizes[below];
        if (size > CWBVH_LEAF) {
            set_byte(node.meta, place, 0x20u | (24u + place));
            node.exponents |= 1u << (24 + place);
            task.next_items[2 * item] = below;
            task.next_items[2 * item++ + 1] = next_child++;
        } else {
            set_byte(node.meta, place, ((1u << size) - 1u) << 5 | next_leaf);
            write_leaves(task, below, node.first_leaf + next_leaf);
            next_leaf += size;
        }
    }
    quantise(box_of(task.nodes[root]), box, count, at, &node);
    task.wide[to] = node;
}

}  // namespace luch

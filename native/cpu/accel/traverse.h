// Walking the eight-wide tree with one ray: closest hit and any hit, over a leaf test given as a callable.
#pragma once
#include <utility>

#include "cpu/accel/bvh8.h"
#include "cpu/accel/simd.h"
#include "luch/accel/primitives.h"
#include "luch/geometry/box.h"
#include "luch/geometry/triangle.h"
#include "luch/math/bounds.h"

namespace luch::cpu {

// A ray as two vectors; w is free.
struct alignas(16) LaneRay {
    float origin[4], direction[4];
    f4 o() const { return load<f4>(origin); }
    f4 d() const { return load<f4>(direction); }
    Vec3 origin3() const { return {origin[0], origin[1], origin[2]}; }
    Vec3 direction3() const { return {direction[0], direction[1], direction[2]}; }
};

// By two vector loads: piecewise copies would stall the vector loads that follow.
LUCH_FN LaneRay lane_ray(const Ray& ray) {
    static_assert(sizeof(Ray) == sizeof(LaneRay));
    LaneRay out;
    __builtin_memcpy(&out, &ray, sizeof(Ray));
    return out;
}
LUCH_FN f4 abs_of(f4 x) { return min_of(max_of(x, -x), splat<f4>(INFINITE_DISTANCE)); }

// A ray against the boxes of one tree, spread over lanes: make_box_ray (box.h), three axes at a time.
struct NodeRay {
    f8 near_origin[3], far_origin[3], near_rdir[3], far_rdir[3];
    f8 t_min;
    u32 near_plane[3], far_plane[3];  // byte offsets of rows of Node8::bounds

    NodeRay(const LaneRay& ray, const Box& root, float t_min_) : t_min(splat<f8>(t_min_)) {
        f4 o = ray.o(), d = ray.d(), steep = abs_of(d);
        float steepest = max_f(max_f(steep[0], steep[1]), steep[2]);
        f4 slope = splat<f4>(SHEAR_ERROR * steepest);
        if (mask_lt(steep, 4.0f * slope) & 7u) {  // parallel to some planes
            spread(make_box_ray(ray.origin3(), ray.direction3(), root));
            return;
        }
        f4 one = splat<f4>(1.0f);
        alignas(16) float near_r[4], far_r[4];
        store(near_r, one / (steep + slope) * SLAB_DOWN);
        store(far_r, one / (steep - slope) * SLAB_UP);
        for (u32 axis = 0; axis < 3; ++axis) {
            near_origin[axis] = far_origin[axis] = splat<f8>(o[axis]);
            near_rdir[axis] = splat<f8>(copysign_f(near_r[axis], d[axis]));
            far_rdir[axis] = splat<f8>(copysign_f(far_r[axis], d[axis]));
            choose_planes(axis, float_bits(d[axis]) >> 31);
        }
    }
    NodeRay(const BoxRay& ray, float t_min_) : t_min(splat<f8>(t_min_)) { spread(ray); }

 private:
    void choose_planes(u32 axis, u32 negative) {
        near_plane[axis] = 32 * (axis + 3 * negative);
        far_plane[axis] = 32 * (axis + 3 * (1 - negative));
    }
    void spread(const BoxRay& ray) {
        for (u32 axis = 0; axis < 3; ++axis) {
            near_origin[axis] = splat<f8>(ray.near_origin[axis]);
            far_origin[axis] = splat<f8>(ray.far_origin[axis]);
            near_rdir[axis] = splat<f8>(ray.near_rdir[axis]);
            far_rdir[axis] = splat<f8>(ray.far_rdir[axis]);
            choose_planes(axis, ray.negative[axis]);
        }
    }
};

// Bits of the children that the ray may hit before t_max, and where it enters them.
LUCH_FN u32 intersect_node(const Node8& node, const NodeRay& r, float t_max, f8* entry) {
    const char* bounds = reinterpret_cast<const char*>(node.bounds);
    f8 near_t[3], far_t[3];
    for (int axis = 0; axis < 3; ++axis) {
        near_t[axis] = (load<f8>(bounds + r.near_plane[axis]) - r.near_origin[axis]) * r.near_rdir[axis];
        far_t[axis] = (load<f8>(bounds + r.far_plane[axis]) - r.far_origin[axis]) * r.far_rdir[axis];
    }
    // 0 * inf, a ray in a face's plane, is NaN. The order drops it (at worst with its neighbour): the test
    // then says yes where it need not.
    f8 enter = max_of(max_of(near_t[0], near_t[1]), max_of(near_t[2], r.t_min));
    f8 leave = min_of(min_of(far_t[0], far_t[1]), min_of(far_t[2], splat<f8>(t_max)));
    *entry = enter;
    return mask_le(enter, leave);
}

// A ray against triangle blocks: make_triangle_ray (triangle.h), spread over lanes.
struct BlockRay {
    f4 origin[3];  // by shear axis: x, y, z
    f4 shear_x, shear_y, scale_z;
    double scale_z_exact;
    float t_min;
    u32 axis[3];  // byte offsets of rows within a vertex of Block4

    BlockRay(const LaneRay& ray, float t_min_) : t_min(t_min_) {
        const float* d = ray.direction;
        f4 steep = abs_of(ray.d());
        u32 kz = steep[1] > steep[0] ? 1 : 0;
        kz = steep[2] > max_f(steep[0], steep[1]) ? 2 : kz;
        float dz = d[kz];
        // Which axes are x and y, by z's axis and sign: no branch, random rays would mispredict it.
        static constexpr u8 X[8] = {1, 2, 0, 0, 2, 0, 1, 0}, Y[8] = {2, 0, 1, 0, 1, 2, 0, 0};
        u32 kind = kz + 4 * (float_bits(dz) >> 31), kx = X[kind], ky = Y[kind];
        axis[0] = 16 * kx;
        axis[1] = 16 * ky;
        axis[2] = 16 * kz;
        origin[0] = splat<f4>(ray.origin[kx]);
        origin[1] = splat<f4>(ray.origin[ky]);
        origin[2] = splat<f4>(ray.origin[kz]);
        shear_x = splat<f4>(d[kx] / dz);
        shear_y = splat<f4>(d[ky] / dz);
        scale_z = splat<f4>(1.0f / dz);
        scale_z_exact = 1.0 / double(dz);
    }
};

struct BlockHits {
    alignas(16) float t[4], u[4], v[4];
};

// Bits of the lanes hit in (t_min, t_max]. The same operations as intersect_triangle, so the same bits; the
// float pass before them only sorts out lanes that intersect_triangle is sure to refuse.
LUCH_FN u32 intersect_block(const Block4& block, const BlockRay& r, float t_max, BlockHits* hits) {
    f4 x[3], y[3], z[3];
    for (int k = 0; k < 3; ++k) {
        const char* vertex = reinterpret_cast<const char*>(block.vertex[k]);
        z[k] = load<f4>(vertex + r.axis[2]) - r.origin[2];
        x[k] = (load<f4>(vertex + r.axis[0]) - r.origin[0]) - r.shear_x * z[k];
        y[k] = (load<f4>(vertex + r.axis[1]) - r.origin[1]) - r.shear_y * z[k];
    }
    // Rounding is monotone, so a float edge function is zero or has the right sign (or overflowed to NaN).
    f4 u = x[2] * y[1] - y[2] * x[1];
    f4 v = x[0] * y[2] - y[0] * x[2];
    f4 w = x[1] * y[0] - y[1] * x[0];
    f4 zero = {};
    u32 outside = mask_lt(min_of(min_of(u, v), w), zero) & mask_lt(zero, max_of(max_of(u, v), w));
    // t is a weighted mean of the vertices' depths. Empty lanes are NaN and fail here.
    f4 depth[3] = {z[0] * r.scale_z, z[1] * r.scale_z, z[2] * r.scale_z};
    f4 nearest = min_of(min_of(depth[0], depth[1]), depth[2]) * splat<f4>(SLAB_DOWN);
    f4 farthest = max_of(max_of(depth[0], depth[1]), depth[2]) * splat<f4>(SLAB_UP);
    u32 candidates = mask_le(nearest, splat<f4>(t_max)) & mask_le(splat<f4>(r.t_min), farthest) & ~outside;
    if (!candidates) return 0;

    d4 dx[3], dy[3], dz[3];
    for (int k = 0; k < 3; ++k) {
        dx[k] = __builtin_convertvector(x[k], d4);
        dy[k] = __builtin_convertvector(y[k], d4);
        dz[k] = __builtin_convertvector(z[k], d4);
    }
    d4 du = dx[2] * dy[1] - dy[2] * dx[1];
    d4 dv = dx[0] * dy[2] - dy[0] * dx[2];
    d4 dw = dx[1] * dy[0] - dy[1] * dx[0];
    d4 none = {};
    outside = mask_lt(min_of(min_of(du, dv), dw), none) & mask_lt(none, max_of(max_of(du, dv), dw));
    d4 reciprocal = splat<d4>(1.0) / ((du + dv) + dw);
    d4 depth_sum = (du * dz[0] + dv * dz[1]) + dw * dz[2];
    f4 t = __builtin_convertvector((depth_sum * reciprocal) * splat<d4>(r.scale_z_exact), f4);
    store(hits->t, t);
    store(hits->u, __builtin_convertvector(dv * reciprocal, f4));
    store(hits->v, __builtin_convertvector(dw * reciprocal, f4));
    return candidates & ~outside & mask_lt(splat<f4>(r.t_min), t) & mask_le(t, splat<f4>(t_max));
}

LUCH_FN u64 pack(float distance, u32 child) { return u64(float_bits(distance)) << 32 | child; }
LUCH_FN float distance_of(u64 entry) { return bits_float(u32(entry >> 32)); }
// Splits the lanes of a mask into branches, one per lane, each with its lane as a constant. A predicted branch
// knows the address of the next node before the box test is done; index arithmetic on the mask would wait for
// it (measured: 1.2 to 1.5 times the primary rays). `act` is forced inline; lanes go upwards.
template <u32 LANE = 0, class Act>
LUCH_FN void for_first_lane(u32 mask, Act&& act) {
    if constexpr (LANE < 7) {
        if (!(mask & (1u << LANE))) return for_first_lane<LANE + 1>(mask, act);
    }
    act(LANE);
}
template <u32 LANE = 1, class Act>
LUCH_FN void for_lanes(u32 mask, Act&& act) {
    if constexpr (LANE < 8) {
        if (mask & (1u << LANE)) act(LANE);
        for_lanes<LANE + 1>(mask, act);
    }
}
// Keeps the compiler from turning the branch around it into arithmetic.
LUCH_FN void keep_branch(u32& value) { asm volatile("" : "+r"(value)); }

// Pushes all children of mask but the nearest, farthest first; returns the nearest.
LUCH_FN u32 push_children(const Node8& node, u32 mask, f8 entry, u64** top_of_stack) {
    alignas(32) float distance[8];
    store(distance, entry);
    u32 nearest = 0;
    float nearest_distance = 0.0f;
    for_first_lane(mask, [&](u32 lane) {
        nearest = node.child[lane];
        nearest_distance = distance[lane];
        keep_branch(nearest);
    });
    mask &= mask - 1;
    if (!mask) return nearest;
    u64* own = *top_of_stack;
    u64* top = own;
    for_lanes(mask, [&](u32 lane) {
        u32 farther = node.child[lane];
        float farther_distance = distance[lane];
        if (farther_distance < nearest_distance) {
            std::swap(nearest, farther);
            std::swap(nearest_distance, farther_distance);
            keep_branch(nearest);
        }
        u64 entered = pack(farther_distance, farther);
        u64* place = top++;  // this node's entries stay sorted, nearest on top
        for (; place > own && place[-1] < entered; --place) *place = place[-1];
        *place = entered;
    });
    *top_of_stack = top;
    return nearest;
}

// Calls leaf(its child word) nearest leaves first; leaf lowers *t_max when it finds a hit. Boxes entered
// at exactly t_max are still visited: a hit there may have the smaller id.
template <class Leaf, class Count>
LUCH_FN void visit_closest(const Node8* nodes, const NodeRay& ray, const float* t_max, Leaf&& leaf, Count& count) {
    u64 stack[STACK_SIZE];  // entry distance, child: never negative, so distances sort as integers do
    u64* top = stack;
    u32 current = 0;
    for (;;) {
        while (!(current & LEAF)) {
            const Node8& node = nodes[current];
            count.node(sizeof(Node8), 8);
            f8 entry;
            u32 mask = intersect_node(node, ray, *t_max, &entry);
            if (!mask) goto pop;
            current = push_children(node, mask, entry, &top);
        }
        leaf(current);
    pop:
        do {
            if (top == stack) return;
            --top;
        } while (!(distance_of(*top) <= *t_max));
        current = u32(*top);
    }
}

// Calls leaf(its child word) in no particular order until it returns true.
template <class Leaf, class Count>
LUCH_FN void visit_any(const Node8* nodes, const NodeRay& ray, float t_max, Leaf&& leaf, Count& count) {
    u32 stack[STACK_SIZE];
    u32* top = stack;
    u32 current = 0;
    for (;;) {
        while (!(current & LEAF)) {
            const Node8& node = nodes[current];
            count.node(sizeof(Node8), 8);
            f8 entry;
            u32 mask = intersect_node(node, ray, t_max, &entry);
            if (!mask) goto pop;
            for_first_lane(mask, [&](u32 lane) {
                current = node.child[lane];
                keep_branch(current);
            });
            for (mask &= mask - 1; mask; mask &= mask - 1) *top++ = node.child[__builtin_ctz(mask)];
        }
        if (leaf(current)) return;
    pop:
        if (top == stack) return;
        current = *--top;
    }
}

}  // namespace luch::cpu

// A leaf of spheres against one ray: eight are looked at together, and those that may be hit take the one test that
// every structure uses (geometry/sphere.h), so the hits are the same bit for bit.
#pragma once
#include "cpu/accel/leaf.h"
#include "luch/geometry/sphere.h"
#include "luch/math/bounds.h"

namespace luch::cpu {

// A ray's line as eight primitives that have a distance from it look at it.
struct BlockLine {
    f8 origin[3], direction[3];  // of length near 1: squares keep their range
    f8 inverse_a;

    BlockLine(Vec3 from, Vec3 along) {
        Vec3 d = along * (1.0f / max_component(abs_v(along)));
        for (int axis = 0; axis < 3; ++axis) {
            origin[axis] = splat<f8>(from[axis]);
            direction[axis] = splat<f8>(d[axis]);
        }
        inverse_a = splat<f8>(1.0f / dot(d, d));
    }
};

// Bits of the lanes whose squared distance is not surely beyond the limit.
LUCH_FN u32 lanes_within(f8 distance2, f8 limit) {
    f8 limit2 = limit * limit + DENORMAL_SLACK;  // denormal squares have few digits
    // Where a square overflowed or is NaN, the test decides.
    return ~(mask_le(limit2, distance2) & mask_le(distance2, splat<f8>(3.402823466e+38f))) & 255u;
}

template <Precision P>
struct SphereBlockRay : BlockLine {
    Vec3 exact_origin, exact_direction;
    float t_min;

    SphereBlockRay(const LaneRay& ray, float t_min_)
        : BlockLine(ray.origin3(), ray.direction3()),
          exact_origin(ray.origin3()),
          exact_direction(ray.direction3()),
          t_min(t_min_) {}
};

// Bits of the lanes that the ray's line may touch; never drops one that the test would take.
template <Precision P>
LUCH_FN u32 line_may_touch(const SphereBlock& block, const SphereBlockRay<P>& ray) {
    f8 f[3], along = {}, reach = {}, distance2 = {};
    for (int axis = 0; axis < 3; ++axis) {
        f[axis] = load<f8>(block.center[axis]) - ray.origin[axis];
        along += f[axis] * ray.direction[axis];
        reach += max_of(f[axis], -f[axis]);
    }
    f8 s = along * ray.inverse_a;
    for (int axis = 0; axis < 3; ++axis) {
        f8 p = f[axis] - s * ray.direction[axis];
        distance2 += p * p;
    }
    f8 radius = load<f8>(block.radius);
    return lanes_within(distance2, max_of(radius, -radius) * SLAB_UP + reach * LINE_SLACK);
}

template <Precision P>
LUCH_FN bool hit_sphere(const SphereBlock& block, u32 lane, const SphereBlockRay<P>& ray, float t_max, float* t) {
    Vec3 center = {block.center[0][lane], block.center[1][lane], block.center[2][lane]};
    return intersect_sphere<P>(ray.exact_origin, ray.exact_direction, {center, block.radius[lane]}, ray.t_min, t_max,
                               t);
}

template <Precision P, class Count>
LUCH_FN void closest_in_leaf(const Group& group, const SphereBlockRay<P>& ray, u32 leaf, RefHit* best, Count& count) {
    u32 first = leaf_first(leaf), end = first + leaf_items(leaf);
    for (u32 b = first; b < end; ++b) {
        const SphereBlock& block = group.sphere_blocks[b];
        count_block(block, count);
        for (u32 mask = line_may_touch(block, ray); mask; mask &= mask - 1) {
            u32 lane = u32(__builtin_ctz(mask));
            float t;
            if (hit_sphere(block, lane, ray, best->t, &t)) offer(t, block.ref[lane], 0.0f, 0.0f, best);
        }
    }
}

template <Precision P, class Count>
LUCH_FN void any_in_leaf(const Group& group, const SphereBlockRay<P>& ray, u32 leaf, float t_max, u8* result,
                         Count& count) {
    u32 first = leaf_first(leaf), end = first + leaf_items(leaf);
    for (u32 b = first; b < end; ++b) {
        const SphereBlock& block = group.sphere_blocks[b];
        count_block(block, count);
        for (u32 mask = line_may_touch(block, ray); mask; mask &= mask - 1) {
            u32 lane = u32(__builtin_ctz(mask));
            float t;
            if (hit_sphere(block, lane, ray, t_max, &t)) note_blocked(block.ref[lane], result);
        }
    }
}

}  // namespace luch::cpu

// A leaf of pieces of curves against one ray: eight are looked at together, as capsules, and those that may be hit take
// the one test that every structure uses (geometry/curve_test.h), so the hits are the same bit for bit.
#pragma once
#include "cpu/accel/leaf.h"
#include "cpu/accel/sphere_blocks.h"
#include "luch/geometry/curve_test.h"

namespace luch::cpu {

template <Precision P>
struct CurveBlockRay : BlockLine {
    CurveRay<typename CurveNumber<P>::Type> exact;
    float t_min;

    CurveBlockRay(const LaneRay& ray, float t_min_)
        : BlockLine(ray.origin3(), ray.direction3()),
          exact(make_curve_ray<typename CurveNumber<P>::Type>(ray.origin3(), ray.direction3())),
          t_min(t_min_) {}
};

// Bits of the lanes whose capsules the ray's line may touch; never drops one that the test would take. The same bound
// as line_may_touch of geometry/curve_test.h.
template <Precision P>
LUCH_FN u32 line_may_touch(const CurveBlock& block, const CurveBlockRay<P>& ray) {
    f8 f[3], e[3], f_along = {}, e_along = {}, reach = {};
    for (int axis = 0; axis < 3; ++axis) {
        f8 a = load<f8>(block.a[axis]);
        f[axis] = a - ray.origin[axis];
        e[axis] = load<f8>(block.b[axis]) - a;
        f_along += f[axis] * ray.direction[axis];
        e_along += e[axis] * ray.direction[axis];
        reach += max_of(f[axis], -f[axis]) + max_of(e[axis], -e[axis]);
    }
    f_along *= ray.inverse_a;
    e_along *= ray.inverse_a;
    f8 pq = {}, qq = {};
    for (int axis = 0; axis < 3; ++axis) {
        f[axis] -= f_along * ray.direction[axis];
        e[axis] -= e_along * ray.direction[axis];
        pq += f[axis] * e[axis];
        qq += e[axis] * e[axis];
    }
    f8 w = min_of(max_of(-pq / max_of(qq, splat<f8>(1e-37f)), f8{}), splat<f8>(1.0f)), distance2 = {};
    for (int axis = 0; axis < 3; ++axis) {
        f8 n = f[axis] + e[axis] * w;
        distance2 += n * n;
    }
    return lanes_within(distance2, load<f8>(block.radius) + reach * LINE_SLACK);
}

// Calls act(ref, hit) for each piece that the ray meets before *t_max, which act may lower, until it says false.
template <Precision P, class Count, class Act>
LUCH_FN void meet_pieces(const Group& group, const CurveBlockRay<P>& ray, u32 leaf, const float* t_max, Count& count,
                         Act&& act) {
    u32 first = leaf_first(leaf), end = first + leaf_items(leaf);
    for (u32 b = first; b < end; ++b) {
        const CurveBlock& block = group.curve_blocks[b];
        count_block(block, count);
        for (u32 mask = line_may_touch(block, ray); mask; mask &= mask - 1) {
            u32 ref = block.ref[__builtin_ctz(mask)];
            TriangleHit hit;
            if ((ref & REF_MASK) != REF_MASK &&
                intersect_piece(group.curves, ref & REF_MASK, ray.exact, ray.t_min, *t_max, &hit) && !act(ref, hit))
                return;
        }
    }
}

template <Precision P, class Count>
LUCH_FN void closest_in_leaf(const Group& group, const CurveBlockRay<P>& ray, u32 leaf, RefHit* best, Count& count) {
    meet_pieces(group, ray, leaf, &best->t, count, [&](u32 ref, const TriangleHit& hit) {
        offer(hit.t, ref, hit.u, hit.v, best);
        return true;
    });
}

template <Precision P, class Count>
LUCH_FN void any_in_leaf(const Group& group, const CurveBlockRay<P>& ray, u32 leaf, float t_max, u8* result,
                         Count& count) {
    meet_pieces(group, ray, leaf, &t_max, count, [&](u32 ref, const TriangleHit&) {
        note_blocked(ref, result);
        return *result != BLOCKED_OPAQUE;
    });
}

}  // namespace luch::cpu

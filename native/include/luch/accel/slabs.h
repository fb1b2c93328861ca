// A ray against the boxes of one tree: one function for every precision.
#pragma once
#include "luch/accel/primitives.h"
#include "luch/geometry/box.h"

namespace luch {

// Single precision asks for speed and takes the ray as it is; the others make it the cone of math/bounds.h, 1.
template <Precision P>
LUCH_FN BoxRay slab_ray(const Ray& ray, const Box& root) {
    if constexpr (P != Precision::FAST) return make_box_ray(ray.origin, ray.direction, root);
    BoxRay out;
    for (int axis = 0; axis < 3; ++axis) {
        float d = ray.direction[axis];
        out.near_origin[axis] = out.far_origin[axis] = ray.origin[axis];
        out.near_rdir[axis] = out.far_rdir[axis] = 1.0f / d;
        out.negative[axis] = float_bits(d) >> 31;
    }
    return out;
}

// Whether the ray may meet something of the box in [t_min, t_max], and from where on.
LUCH_FN bool enter_box(const BoxRay& ray, const float* lo, const float* hi, float t_min, float t_max, float* enter) {
    float first = t_min, last = t_max;
    for (int axis = 0; axis < 3; ++axis) {
        float near_plane = ray.negative[axis] ? hi[axis] : lo[axis];
        float far_plane = ray.negative[axis] ? lo[axis] : hi[axis];
        // A ray in a face's plane: 0 * infinity is NaN, and then this axis does not count.
        first = max_f((near_plane - ray.near_origin[axis]) * ray.near_rdir[axis], first);
        last = min_f((far_plane - ray.far_origin[axis]) * ray.far_rdir[axis], last);
    }
    *enter = first;
    return first <= last;
}

// What a traversal does with a leaf's refs: keep the better hit, or stop at the first that blocks.
template <Precision P, class Count, class All = Primitives>
struct ClosestInLeaf {
    const All& all;
    const u32* refs;
    PrimitiveRay<P> ray;
    float t_min;
    RefHit* best;
    Count& count;

    LUCH_FN float t_max() const { return best->t; }
    LUCH_FN bool operator()(u32 first, u32 size) {  // true: stop
        count.list(4 * size);
        for (u32 i = first; i < first + size; ++i) offer_primitive(all, ray, refs[i], t_min, best, count);
        return false;
    }
};
template <Precision P, class Count, class All = Primitives>
struct AnyInLeaf {
    const All& all;
    const u32* refs;
    PrimitiveRay<P> ray;
    float t_min, limit;
    u8 blocked;
    Count& count;

    LUCH_FN float t_max() const { return limit; }
    LUCH_FN bool operator()(u32 first, u32 size) {
        count.list(4 * size);
        for (u32 i = first; i < first + size; ++i)
            if (block_primitive(all, ray, refs[i], t_min, limit, &blocked, count)) return true;
        return false;
    }
};

}  // namespace luch

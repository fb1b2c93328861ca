// Axis-aligned boxes, and the slab test that never misses a box whose triangle the ray hits.
#pragma once
#include "luch/geometry/triangle.h"
#include "luch/math/bounds.h"
#include "luch/math/vec.h"

namespace luch {

struct Box {
    Vec3 lo, hi;
};

LUCH_FN Box empty_box() { return {make_vec3(INFINITE_DISTANCE), make_vec3(-INFINITE_DISTANCE)}; }
LUCH_FN void extend(Box& box, Vec3 p) {
    box.lo = min_v(box.lo, p);
    box.hi = max_v(box.hi, p);
}
LUCH_FN void extend(Box& box, const Box& other) {
    box.lo = min_v(box.lo, other.lo);
    box.hi = max_v(box.hi, other.hi);
}

// A triangle's box as the slab test needs it: math/bounds.h, 1.
LUCH_FN Box triangle_box(Vec3 p0, Vec3 p1, Vec3 p2) {
    Vec3 lo = min_v(min_v(p0, p1), p2), hi = max_v(max_v(p0, p1), p2);
    float error =
        SHEAR_ERROR * max_component(hi - lo) + DENORMAL_MARGIN;  // denormal: above() cannot widen such numbers
    return {{below(lo.x - error), below(lo.y - error), below(lo.z - error)},
            {above(hi.x + error), above(hi.y + error), above(hi.z + error)}};
}

// As wide as the ray's cone strays at the ball's size; where along the ray the test's t is exact.
LUCH_FN Box sphere_box(Vec3 center, float radius) {
    float r = abs_f(radius);
    r += SHEAR_ERROR * r;
    return {{below(center.x - r), below(center.y - r), below(center.z - r)},
            {above(center.x + r), above(center.y + r), above(center.z + r)}};
}

// Per axis: the slab interval is (near plane - near_origin) near_rdir .. (far plane - far_origin) far_rdir.
struct BoxRay {
    float near_origin[3], far_origin[3];
    float near_rdir[3], far_rdir[3];
    u32 negative[3];  // 1: the near plane is the upper one (the sign bit, so -0 counts as negative)
};

// root: the box of all triangles that this ray may be tested with. extra: widening per axis (0 for none).
LUCH_FN BoxRay make_box_ray(Vec3 origin, Vec3 direction, const Box& root, float extra = 0.0f) {
    BoxRay out;
    float slope = SHEAR_ERROR * max_component(abs_v(direction));  // the cone's half width at t = 1
    for (int axis = 0; axis < 3; ++axis) {
        float o = origin[axis], d = direction[axis], steep = abs_f(d);
        float near_d = steep + slope, far_d = steep - slope;
        float error = extra;
        if (steep < 4.0f * slope) {  // as good as parallel to the planes: inside or outside all along the box
            near_d = far_d = 0.0f;
            Vec3 extent = max_v(abs_v(root.lo - origin), abs_v(root.hi - origin));
            error += 6.0f * SHEAR_ERROR * max_component(extent);
        }
        u32 negative = float_bits(d) >> 31;
        float sign = negative ? -1.0f : 1.0f;
        out.negative[axis] = negative;
        out.near_origin[axis] = error > 0.0f ? (negative ? below(o - error) : above(o + error)) : o;
        out.far_origin[axis] = error > 0.0f ? (negative ? above(o + error) : below(o - error)) : o;
        // A direction below 1e-38: an infinite factor would put planes out of reach that lie just ahead.
        out.near_rdir[axis] = sign * min_f(1.0f / near_d * SLAB_DOWN, 3e38f);
        out.far_rdir[axis] = sign / far_d * SLAB_UP;
    }
    return out;
}

}  // namespace luch

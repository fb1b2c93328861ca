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
LUCH_FN float half_area(const Box& box) {
    Vec3 d = box.hi - box.lo;
    return d.x * d.y + d.y * d.z + d.z * d.x;
}

// Per axis: the slab interval is (near plane - near_origin) near_rdir .. (far plane - far_origin) far_rdir.
struct BoxRay {
    float near_origin[3], far_origin[3];
    float near_rdir[3], far_rdir[3];
    u32 negative[3];  // 1: the near plane is the upper one (the sign bit, so -0 counts as negative)
};

// root: the box of all triangles that this ray may be tested with. extra: widening per axis (0 for none).
LUCH_FN BoxRay make_box_ray(const TriangleRay& r, Vec3 direction, const Box& root, float extra = 0.0f) {
    BoxRay out;
    Vec3 extent = max_v(abs_v(root.lo - r.origin), abs_v(root.hi - r.origin));
    float extent_z = extent[r.kz];
    for (int axis = 0; axis < 3; ++axis) {
        float o = r.origin[axis], d = direction[axis];
        float error = (axis == r.kz ? 0.0f : SHEAR_ERROR * (extent[axis] + extent_z)) + extra;
        // Rounded outwards: o + error alone may round back to o.
        float above = error > 0.0f ? next_up(o + error) : o;
        float below = error > 0.0f ? next_down(o - error) : o;
        u32 negative = float_bits(d) >> 31;
        float rdir = 1.0f / d;
        out.negative[axis] = negative;
        out.near_origin[axis] = negative ? below : above;
        out.far_origin[axis] = negative ? above : below;
        out.near_rdir[axis] = rdir * SLAB_DOWN;
        out.far_rdir[axis] = rdir * SLAB_UP;
    }
    return out;
}

}  // namespace luch

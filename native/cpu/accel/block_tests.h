// The other precisions of the eight-wide tree's leaves: four triangles at once, the same operations in the same order
// as the tests of triangle_tests.h, so the same bits.
#pragma once
#include "cpu/accel/traverse.h"
#include "luch/geometry/triangle_tests.h"

namespace luch::cpu {

template <class V>
struct Vec3Lanes {
    V x, y, z;
};
template <class V>
LUCH_FN Vec3Lanes<V> minus(const Vec3Lanes<V>& a, const Vec3Lanes<V>& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class V>
LUCH_FN V dot_lanes(const Vec3Lanes<V>& a, const Vec3Lanes<V>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
LUCH_FN Vec3Lanes<V> cross_lanes(const Vec3Lanes<V>& a, const Vec3Lanes<V>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
LUCH_FN Vec3Lanes<f4> vertex_lanes(const Block4& block, int vertex) {
    return {load<f4>(block.vertex[vertex][0]), load<f4>(block.vertex[vertex][1]), load<f4>(block.vertex[vertex][2])};
}

// Precision::FAST: intersect_triangle_barycentric.
struct FastBlockRay {
    Vec3Lanes<f4> origin, direction;
    float t_min;
    FastBlockRay(const LaneRay& ray, float t_min_)
        : origin{splat<f4>(ray.origin[0]), splat<f4>(ray.origin[1]), splat<f4>(ray.origin[2])},
          direction{splat<f4>(ray.direction[0]), splat<f4>(ray.direction[1]), splat<f4>(ray.direction[2])},
          t_min(t_min_) {}
};

LUCH_FN u32 intersect_block(const Block4& block, const FastBlockRay& r, float t_max, BlockHits* hits) {
    Vec3Lanes<f4> p0 = vertex_lanes(block, 0);
    Vec3Lanes<f4> e1 = minus(vertex_lanes(block, 1), p0), e2 = minus(vertex_lanes(block, 2), p0);
    Vec3Lanes<f4> h = cross_lanes(r.direction, e2), s = minus(r.origin, p0);
    Vec3Lanes<f4> q = cross_lanes(s, e1);
    f4 inverse = splat<f4>(1.0f) / dot_lanes(e1, h);
    f4 u = dot_lanes(s, h) * inverse, v = dot_lanes(r.direction, q) * inverse, t = dot_lanes(e2, q) * inverse;
    store(hits->t, t);
    store(hits->u, u);
    store(hits->v, v);
    f4 zero = {};
    return mask_le(zero, u) & mask_le(zero, v) & mask_le(u + v, splat<f4>(1.0f)) & mask_lt(splat<f4>(r.t_min), t) &
           mask_le(t, splat<f4>(t_max));
}

// Precision::DOUBLE: intersect_triangle_double.
struct DoubleBlockRay {
    d4 origin[3];  // by shear axis: x, y, z
    d4 shear_x, shear_y, dz;
    float t_min;
    u32 axis[3];  // byte offsets of rows within a vertex of Block4
    DoubleBlockRay(const LaneRay& ray, float t_min_) : t_min(t_min_) {
        Vec3 a = abs_v(ray.direction3());
        int kz = a.x >= a.y ? (a.x >= a.z ? 0 : 2) : (a.y >= a.z ? 1 : 2);
        int k[3] = {kz == 2 ? 0 : kz + 1, 0, kz};
        k[1] = k[0] == 2 ? 0 : k[0] + 1;
        double z = double(ray.direction[kz]);
        for (int i = 0; i < 3; ++i) {
            origin[i] = splat<d4>(double(ray.origin[k[i]]));
            axis[i] = 16 * u32(k[i]);
        }
        shear_x = splat<d4>(double(ray.direction[k[0]]) / z);
        shear_y = splat<d4>(double(ray.direction[k[1]]) / z);
        dz = splat<d4>(z);
    }
};

LUCH_FN u32 intersect_block(const Block4& block, const DoubleBlockRay& r, float t_max, BlockHits* hits) {
    d4 x[3], y[3], z[3];
    for (int k = 0; k < 3; ++k) {
        const char* vertex = reinterpret_cast<const char*>(block.vertex[k]);
        z[k] = __builtin_convertvector(load<f4>(vertex + r.axis[2]), d4) - r.origin[2];
        x[k] = (__builtin_convertvector(load<f4>(vertex + r.axis[0]), d4) - r.origin[0]) - r.shear_x * z[k];
        y[k] = (__builtin_convertvector(load<f4>(vertex + r.axis[1]), d4) - r.origin[1]) - r.shear_y * z[k];
    }
    d4 u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    d4 none = {};
    u32 outside = mask_lt(min_of(min_of(u, v), w), none) & mask_lt(none, max_of(max_of(u, v), w));
    d4 reciprocal = splat<d4>(1.0) / ((u + v) + w);
    f4 t = __builtin_convertvector((((u * z[0] + v * z[1]) + w * z[2]) * reciprocal) / r.dz, f4);
    store(hits->t, t);
    store(hits->u, __builtin_convertvector(v * reciprocal, f4));
    store(hits->v, __builtin_convertvector(w * reciprocal, f4));
    return ~outside & mask_lt(splat<f4>(r.t_min), t) & mask_le(t, splat<f4>(t_max)) & 15u;
}

}  // namespace luch::cpu

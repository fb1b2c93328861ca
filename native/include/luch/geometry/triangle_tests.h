// The other triangle tests: those of the lecture, in single precision, and a double-precision reference.
// Operations are counted for a ray that passes all tests, differences as sums; setup per triangle is none.
#pragma once
#include "luch/geometry/triangle.h"

namespace luch {

// Moeller, Trumbore 1997, with a division at the end of the accepting path only: 27 mul, 24 add, 1 div.
LUCH_FN bool intersect_triangle_barycentric(Vec3 origin, Vec3 direction, Vec3 p0, Vec3 p1, Vec3 p2, float t_min,
                                            float t_max, TriangleHit* hit) {
    Vec3 e1 = p1 - p0, e2 = p2 - p0;
    Vec3 h = cross(direction, e2);
    float det = dot(e1, h);
    Vec3 s = origin - p0;
    float u = dot(s, h);
    Vec3 q = cross(s, e1);
    float v = dot(direction, q);
    float inverse = 1.0f / det;  // parallel: infinite, and nothing below holds
    u *= inverse;
    v *= inverse;
    float t = dot(e2, q) * inverse;
    if (!(u >= 0.0f && v >= 0.0f && u + v <= 1.0f && t > t_min && t <= t_max)) return false;  // NaN: miss
    *hit = {t, u, v};
    return true;
}

// The plane first, then the point's barycentrics by the triangle's two edges in that plane: 38 mul, 36 add, 2 div.
LUCH_FN bool intersect_triangle_plane(Vec3 origin, Vec3 direction, Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max,
                                      TriangleHit* hit) {
    Vec3 e1 = p1 - p0, e2 = p2 - p0;
    Vec3 normal = cross(e1, e2);
    float t = dot(p0 - origin, normal) / dot(direction, normal);
    if (!(t > t_min && t <= t_max)) return false;  // NaN, in the plane: miss
    Vec3 p = (origin + direction * t) - p0;
    float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2), dp1 = dot(p, e1), dp2 = dot(p, e2);
    float inverse = 1.0f / (d11 * d22 - d12 * d12);
    float u = (d22 * dp1 - d12 * dp2) * inverse, v = (d11 * dp2 - d12 * dp1) * inverse;
    if (!(u >= 0.0f && v >= 0.0f && u + v <= 1.0f)) return false;
    *hit = {t, u, v};
    return true;
}

// The watertight test with nothing rounded to single precision before t, u and v.
LUCH_FN bool intersect_triangle_double(Vec3 origin, Vec3 direction, Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max,
                                       TriangleHit* hit) {
    Vec3 a = abs_v(direction);
    int kz = a.x >= a.y ? (a.x >= a.z ? 0 : 2) : (a.y >= a.z ? 1 : 2);
    int kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    double dz = double(direction[kz]), sx = double(direction[kx]) / dz, sy = double(direction[ky]) / dz;
    Vec3 p[3] = {p0, p1, p2};
    double x[3], y[3], z[3];
    for (int k = 0; k < 3; ++k) {
        z[k] = double(p[k][kz]) - double(origin[kz]);
        x[k] = (double(p[k][kx]) - double(origin[kx])) - sx * z[k];
        y[k] = (double(p[k][ky]) - double(origin[ky])) - sy * z[k];
    }
    double u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    double reciprocal = 1 / ((u + v) + w);
    float t = float((((u * z[0] + v * z[1]) + w * z[2]) * reciprocal) / dz);
    if (!(t > t_min && t <= t_max)) return false;  // NaN: miss
    *hit = {t, float(v * reciprocal), float(w * reciprocal)};
    return true;
}

}  // namespace luch

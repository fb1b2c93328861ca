// The watertight triangle test of Woop, Benthin, Wald 2013 ("Watertight Ray/Triangle Intersection"), with
// the weights of an accepted triangle taken in double: products of two floats are exact there, so signs are
// exact for the sheared vertices and t, u, v hold their precision on slivers and edge-on triangles too.
//
// The hit of a set of triangles is the smallest t in (t_min, t_max]; on equal t the smaller id.
#pragma once
#include "luch/geometry/ray.h"
#include "luch/math/bounds.h"
#include "luch/math/vec.h"

namespace luch {

// A ray in the test's frame: z is the dominant axis of the direction, x and y keep the winding.
struct TriangleRay {
    Vec3 origin;
    int kx, ky, kz;
    float shear_x, shear_y, scale_z;  // d_x / d_z, d_y / d_z, 1 / d_z
    double scale_z_exact;             // 1 / d_z for the accepted triangle's t
};

struct TriangleHit {
    float t, u, v;
};

LUCH_FN TriangleRay make_triangle_ray(Vec3 origin, Vec3 direction) {
    TriangleRay r;
    Vec3 a = abs_v(direction);
    r.kz = a.x >= a.y ? (a.x >= a.z ? 0 : 2) : (a.y >= a.z ? 1 : 2);
    r.kx = r.kz == 2 ? 0 : r.kz + 1;
    r.ky = r.kx == 2 ? 0 : r.kx + 1;
    float dz = direction[r.kz];
    if (dz < 0.0f) {
        int k = r.kx;
        r.kx = r.ky;
        r.ky = k;
    }
    r.origin = origin;
    r.shear_x = direction[r.kx] / dz;
    r.shear_y = direction[r.ky] / dz;
    r.scale_z = 1.0f / dz;
    r.scale_z_exact = 1 / double(dz);
    return r;
}

// False for a triangle that is a line or a point: no ray should meet it, and its rounded edges might. Differences of
// floats and their products are exact in double (but for coordinates 2^28 apart in size, whose triangle is a needle).
LUCH_FN bool triangle_has_area(Vec3 p0, Vec3 p1, Vec3 p2) {
    double ax = double(p1.x) - double(p0.x), ay = double(p1.y) - double(p0.y), az = double(p1.z) - double(p0.z);
    double bx = double(p2.x) - double(p0.x), by = double(p2.y) - double(p0.y), bz = double(p2.z) - double(p0.z);
    return ay * bz != az * by || az * bx != ax * bz || ax * by != ay * bx;
}

LUCH_FN bool point_can_be_traced(Vec3 p) {  // NaN: no
    return abs_f(p.x) <= LARGEST_COORDINATE && abs_f(p.y) <= LARGEST_COORDINATE && abs_f(p.z) <= LARGEST_COORDINATE;
}

// What every builder leaves out, on the CPU and on CUDA alike, so that they have the same triangles to hit.
LUCH_FN bool triangle_can_be_traced(Vec3 p0, Vec3 p1, Vec3 p2) {
    return point_can_be_traced(p0) && point_can_be_traced(p1) && point_can_be_traced(p2) &&
           triangle_has_area(p0, p1, p2);
}

// False for rays that can hit nothing: not finite, no direction, an empty or NaN interval.
LUCH_FN bool ray_is_valid(const Ray& ray) {
    Vec3 a = abs_v(ray.direction);
    float largest = max_component(a);
    return finite_v(ray.origin) && finite_v(ray.direction) && largest >= SMALLEST_DIRECTION &&
           largest <= LARGEST_DIRECTION && ray.t_max > 0.0f && ray.t_min < ray.t_max;
}

// Hits lie in (t_min, t_max]; t_min >= 0, t_max <= the largest float.
LUCH_FN bool intersect_triangle(const TriangleRay& r, Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max,
                                TriangleHit* hit) {
    Vec3 a = p0 - r.origin, b = p1 - r.origin, c = p2 - r.origin;
    float az = a[r.kz], bz = b[r.kz], cz = c[r.kz];
    float ax = a[r.kx] - r.shear_x * az, ay = a[r.ky] - r.shear_y * az;
    float bx = b[r.kx] - r.shear_x * bz, by = b[r.ky] - r.shear_y * bz;
    float cx = c[r.kx] - r.shear_x * cz, cy = c[r.ky] - r.shear_y * cz;
    double u = double(cx) * double(by) - double(cy) * double(bx);
    double v = double(ax) * double(cy) - double(ay) * double(cx);
    double w = double(bx) * double(ay) - double(by) * double(ax);
    bool outside = (u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0);
    if (outside) return false;
    double reciprocal = 1 / ((u + v) + w);  // infinite for a degenerate triangle: t is NaN
    double z = (u * double(az) + v * double(bz)) + w * double(cz);
    float t = float((z * reciprocal) * r.scale_z_exact);
    if (!(t > t_min && t <= t_max)) return false;  // NaN: miss
    *hit = {t, float(v * reciprocal), float(w * reciprocal)};
    return true;
}

}  // namespace luch

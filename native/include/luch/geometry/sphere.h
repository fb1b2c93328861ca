// Spheres, by a quadratic that does not cancel: the discriminant is taken from the distance between the centre
// and the ray's line (Haines, Gunther, Akenine-Moeller 2019, "Precision Improvements for Ray/Sphere Intersection"),
// and the second root is the product of the roots over the first.
#pragma once
#include "luch/geometry/precision.h"
#include "luch/geometry/ray.h"
#include "luch/geometry/triangle.h"
#include "luch/math/vec.h"

namespace luch {

// A radius below zero: a ball of that size of which only the outside is there. A ray that starts within leaves
// unseen, as through Blender's point clouds (Cycles drops their back faces).
struct Sphere {
    Vec3 center;
    float radius;
};

LUCH_FN float root_of(float x) { return __builtin_sqrtf(x); }
LUCH_FN double root_of(double x) { return __builtin_sqrt(x); }

LUCH_FN bool sphere_can_be_traced(const Sphere& sphere) {  // NaN: no
    float radius = abs_f(sphere.radius);
    return point_can_be_traced(sphere.center) && radius > 0.0f && radius <= LARGEST_COORDINATE;
}

// Both distances along the ray, near then far, in F; false if the line misses or the sphere has no size.
template <class F>
LUCH_FN bool sphere_distances(Vec3 origin, Vec3 direction, const Sphere& sphere, F* near_t, F* far_t) {
    F dx = F(direction.x), dy = F(direction.y), dz = F(direction.z), r = F(abs_f(sphere.radius));
    F fx = F(origin.x) - F(sphere.center.x), fy = F(origin.y) - F(sphere.center.y),
      fz = F(origin.z) - F(sphere.center.z);
    F a = dx * dx + dy * dy + dz * dz;
    F b = -(fx * dx + fy * dy + fz * dz);
    F s = b / a;
    F px = fx + s * dx, py = fy + s * dy, pz = fz + s * dz;  // the line's point nearest to the centre
    F discriminant = r * r - (px * px + py * py + pz * pz);
    if (!(r > F(0)) || !(discriminant >= F(0))) return false;  // NaN: miss
    F c = fx * fx + fy * fy + fz * fz - r * r;
    F root = root_of(a * discriminant);
    F q = b + (b < F(0) ? -root : root);
    F t0 = q / a, t1 = q == F(0) ? t0 : c / q;
    *near_t = t0 < t1 ? t0 : t1;
    *far_t = t0 < t1 ? t1 : t0;
    return true;
}

// The nearest hit in (t_min, t_max]: the far side counts too, from inside, where the radius is positive. t alone; a
// sphere has no u, v.
template <Precision P>
LUCH_FN bool intersect_sphere(Vec3 origin, Vec3 direction, const Sphere& sphere, float t_min, float t_max, float* t) {
    float roots[2];
    if constexpr (P == Precision::FAST) {
        if (!sphere_distances<float>(origin, direction, sphere, &roots[0], &roots[1])) return false;
    } else {
        double near_t, far_t;
        if (!sphere_distances<double>(origin, direction, sphere, &near_t, &far_t)) return false;
        roots[0] = float(near_t);
        roots[1] = float(far_t);
    }
    const int sides = sphere.radius < 0.0f ? 1 : 2;
    for (int side = 0; side < sides; ++side)
        if (roots[side] > t_min && roots[side] <= t_max) {  // NaN: miss
            *t = roots[side];
            return true;
        }
    return false;
}

}  // namespace luch

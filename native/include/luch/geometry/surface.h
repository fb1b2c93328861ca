// The point that a hit names, how far off it may be, and where the next ray starts.
#pragma once
#include "luch/geometry/curve.h"
#include "luch/geometry/ray.h"
#include "luch/geometry/sphere.h"
#include "luch/math/bounds.h"
#include "luch/math/vec.h"
#include "luch/shade/scene_view.h"

namespace luch {

// p is within error, axis by axis, of the surface as any later ray will meet it (math/bounds.h, 2).
struct SurfacePoint {
    Vec3 p, error;  // world
    Vec3 outward;   // of a sphere or curve: its unit normal, away from the inside; zero: a triangle
    Vec3 radial;    // of these: unit, from the centre to p, the normal that is shaded. An instance may stretch them:
                    // then the two differ
};

LUCH_FN Vec3 transform_magnitude(const Affine& a, Vec3 magnitude) {
    return {abs_f(a.m[0]) * magnitude.x + abs_f(a.m[1]) * magnitude.y + abs_f(a.m[2]) * magnitude.z,
            abs_f(a.m[4]) * magnitude.x + abs_f(a.m[5]) * magnitude.y + abs_f(a.m[6]) * magnitude.z,
            abs_f(a.m[8]) * magnitude.x + abs_f(a.m[9]) * magnitude.y + abs_f(a.m[10]) * magnitude.z};
}
LUCH_FN Vec3 translation_magnitude(const Affine& a) { return {abs_f(a.m[3]), abs_f(a.m[7]), abs_f(a.m[11])}; }

// A point of object space, with the error and the extent of what it lies on (math/bounds.h, 2), taken to the world.
LUCH_FN SurfacePoint instance_point(Vec3 object, Vec3 object_error, float extent, const Affine& to_world,
                                    const Affine& to_object) {
    Vec3 world = transform_point(to_world, object);
    Vec3 back = transform_magnitude(to_object, abs_v(world)) + translation_magnitude(to_object);
    // A flattened instance has no inverse: it is traced in the world, and no ray goes back.
    if (finite_v(back)) object_error += gamma_f(4) * back;
    Vec3 forward = transform_magnitude(to_world, abs_v(object) + make_vec3(extent)) + translation_magnitude(to_world);
    return {world, transform_magnitude(to_world, object_error) + gamma_f(8) * forward, {}, {}};
}

// The unit vector from a sphere's centre to where a ray of its space enters it (or comes nearest, where the test's
// rounding saw a hit). In double: a sphere may be tiny beside its distance from the ray's origin.
LUCH_FN Vec3 entered_at(const Sphere& sphere, Vec3 origin, Vec3 direction) {
    double dx = double(direction.x), dy = double(direction.y), dz = double(direction.z);
    double fx = double(origin.x) - double(sphere.center.x), fy = double(origin.y) - double(sphere.center.y),
           fz = double(origin.z) - double(sphere.center.z);
    double a = dx * dx + dy * dy + dz * dz, r = double(abs_f(sphere.radius));
    double s = -(fx * dx + fy * dy + fz * dz) / a;
    double px = fx + s * dx, py = fy + s * dy, pz = fz + s * dz;  // the line's point nearest to the centre
    double inside = r * r - (px * px + py * py + pz * pz);
    double back = inside > 0 ? root_of(inside / a) : 0;
    Vec3 n = {float((px - back * dx) / r), float((py - back * dy) / r), float((pz - back * dz) / r)};
    return normalize_or(n, -normalize(direction));
}

// Across the triangle, twice its area long. Of the two shorter sides: the product of a sliver's long ones cancels, and
// errs by EPS times their length over the short one's, while nothing tells to which side such a normal points.
LUCH_FN Vec3 area_normal(const Triangle& t) {
    Vec3 a = t.p[1] - t.p[0], b = t.p[2] - t.p[1], c = t.p[0] - t.p[2];
    float aa = dot(a, a), bb = dot(b, b), cc = dot(c, c);
    if (aa >= max_f(bb, cc)) return cross(b, c);
    return bb >= cc ? cross(c, a) : cross(a, b);
}

// Of a triangle as rays are tested with it: the point (1 - u - v) p0 + u p1 + v p2, its error, and how far the corners
// are from it at most.
struct TrianglePoint {
    Vec3 p, error;
    float extent;
};
LUCH_FN TrianglePoint traced_point(const Triangle& t, float u, float v) {
    Vec3 b = u * (t.p[1] - t.p[0]), c = v * (t.p[2] - t.p[0]);
    Vec3 p = t.p[0] + (b + c);
    float extent = max_component(max_v(max_v(abs_v(t.p[0] - p), abs_v(t.p[1] - p)), abs_v(t.p[2] - p)));
    return {p, gamma_f(1) * abs_v(p) + gamma_f(5) * (abs_v(b) + abs_v(c)) + make_vec3(gamma_f(7) * extent), extent};
}

LUCH_FN SurfacePoint triangle_point(const Triangle& t, float u, float v, const InstanceView& instance) {
    if (instance.flags & INSTANCE_IN_WORLD) {
        const Affine& m = instance.to_world;  // as the structure's builder took the corners to the world, bit for bit
        TrianglePoint world =
            traced_point({{transform_point(m, t.p[0]), transform_point(m, t.p[1]), transform_point(m, t.p[2])}}, u, v);
        return {world.p, world.error, {}, {}};
    }
    TrianglePoint own = traced_point(t, u, v);
    return instance_point(own.p, own.error, own.extent, instance.to_world, instance.to_object);
}

// Where a ray from outside enters a sphere of an instance, from the ray's own line: t would bring the digits of the distance.
LUCH_FN SurfacePoint sphere_point(const Sphere& sphere, const Ray& ray, const Affine& to_world,
                                  const Affine& to_object) {
    Vec3 n = entered_at(sphere, transform_point(to_object, ray.origin), transform_direction(to_object, ray.direction));
    float radius = abs_f(sphere.radius);
    Vec3 object_error = gamma_f(6) * (abs_v(sphere.center) + make_vec3(radius));
    SurfacePoint point = instance_point(sphere.center + n * radius, object_error, radius, to_world, to_object);
    point.radial = normalize_or(transform_direction(to_world, n), n);
    point.outward = normalize_or(transform_direction_transposed(to_object, n), n);
    return point;
}

// Across a round curve's axis at `center`, unit, to where a ray enters the cylinder that the curve is there; in double for
// the reason of entered_at. met: where the ray is at the hit, relative to the centre, for when it runs along the axis.
LUCH_FN Vec3 entered_cylinder_at(Vec3 center, Vec3 tangent, float radius, Vec3 origin, Vec3 direction, Vec3 met) {
    double ax = double(tangent.x), ay = double(tangent.y), az = double(tangent.z);
    double inverse = 1 / (ax * ax + ay * ay + az * az);
    double dx = double(direction.x), dy = double(direction.y), dz = double(direction.z);
    double fx = double(origin.x) - double(center.x), fy = double(origin.y) - double(center.y),
           fz = double(origin.z) - double(center.z);
    double d_along = (dx * ax + dy * ay + dz * az) * inverse, f_along = (fx * ax + fy * ay + fz * az) * inverse;
    dx -= d_along * ax, dy -= d_along * ay, dz -= d_along * az;  // across the axis
    fx -= f_along * ax, fy -= f_along * ay, fz -= f_along * az;
    double a = dx * dx + dy * dy + dz * dz, r = double(radius), s = -(fx * dx + fy * dy + fz * dz) / a;
    double px = fx + s * dx, py = fy + s * dy, pz = fz + s * dz;
    double inside = r * r - (px * px + py * py + pz * pz), back = inside > 0 ? root_of(inside / a) : 0;
    Vec3 n = {float((px - back * dx) / r), float((py - back * dy) / r), float((pz - back * dz) / r)};
    return normalize_or(n, normalize_or(met, -normalize(direction)));
}

// A point on a curve's piece. The normal that is shaded is that of the round curve, on a ribbon too.
LUCH_FN_SLOW SurfacePoint curve_point(const CurveSegment& s, CurveShape told, const Hit& hit, const Ray& ray,
                                      const Affine& to_world, const Affine& to_object) {
    CurveShape shape = look_of(told);
    Vec3 origin = transform_point(to_object, ray.origin), direction = transform_direction(to_object, ray.direction);
    double t = double(hit.t);
    Vec3 p = {float(double(origin.x) + t * double(direction.x)), float(double(origin.y) + t * double(direction.y)),
              float(double(origin.z) + t * double(direction.z))};
    Vec3 tangent = curve_tangent(s, shape, hit.u), n;
    Vec3 error = gamma_f(2) * abs_v(p);
    float extent = length(s.k[2].p - s.k[1].p);
    if (shape == CurveShape::RIBBON) {
        // Its v is the sine of the round curve's normal against the ray (geometry/curve_test.h).
        Vec3 unit = normalize_or(tangent, {1.0f, 0.0f, 0.0f});
        Vec3 across = normalize_or(cross(unit, -direction), make_vec3(0.0f));
        n = normalize_or(across * hit.v + cross(across, unit) * safe_sqrt(1.0f - sqr(hit.v)), -normalize(direction));
    } else {
        bool cubic = shape == CurveShape::THICK;
        CurveWeights w = curve_weights(hit.u);
        Vec3 center = cubic ? place_of(s, w) : s.k[1].p + (s.k[2].p - s.k[1].p) * hit.u;
        float radius = cubic ? radius_of(s, w) : length(p - center);
        n = cubic ? entered_cylinder_at(center, tangent, radius, origin, direction, p - center)
                  : normalize_or(p - center, -normalize(direction));
        error += make_vec3(THICK_TOLERANCE * radius + gamma_f(32) * extent) + gamma_f(16) * abs_v(center);
        if (cubic)
            p = center + n * radius;
        else
            error += gamma_f(4) * abs_f(hit.t) * abs_v(direction);
    }
    SurfacePoint point = instance_point(p, error, extent, to_world, to_object);
    point.radial = normalize_or(transform_direction_transposed(to_object, n), n);
    point.outward = shape == CurveShape::RIBBON ? -normalize(ray.direction) : point.radial;
    return point;
}

// ray: the one that found the hit, world; time: that it was traced at.
LUCH_FN SurfacePoint surface_point(const SceneView& scene, const Hit& hit, const Ray& ray, float time) {
    InstanceView moved;
    const InstanceView& instance = instance_at_time(scene, hit.instance, time, &moved);
    const MeshView& mesh = scene.meshes[instance.mesh];
    if (is_curve(mesh, hit.prim))
        return curve_point(segment_at(scene, instance, hit.prim, time), scene.curve_shape, hit, ray, instance.to_world,
                           instance.to_object);
    if (is_sphere(mesh, hit.prim)) {
        const float* s = sphere_at(scene, mesh, hit.prim);
        return sphere_point({{s[0], s[1], s[2]}, s[3]}, ray, instance.to_world, instance.to_object);
    }
    return triangle_point(triangle_at(scene, instance, hit.prim, time), hit.u, hit.v, instance);
}

// Where a ray in `direction` leaves p: off the surface by its error bound, to the side that the direction
// points to. n_geometric: the triangle's unit normal, either side. No scene-dependent epsilon.
LUCH_FN Vec3 offset_origin(Vec3 p, Vec3 error, Vec3 n_geometric, Vec3 direction) {
    // The box of errors reaches this far along the normal; 1.01: the normal itself is rounded.
    float distance = 1.01f * dot(abs_v(n_geometric), error);
    Vec3 offset = n_geometric * (dot(direction, n_geometric) < 0.0f ? -distance : distance);
    Vec3 q = p + offset;
    // Adding may have rounded towards the surface.
    return {offset.x > 0.0f ? next_up(q.x) : (offset.x < 0.0f ? next_down(q.x) : q.x),
            offset.y > 0.0f ? next_up(q.y) : (offset.y < 0.0f ? next_down(q.y) : q.y),
            offset.z > 0.0f ? next_up(q.z) : (offset.z < 0.0f ? next_down(q.z) : q.z)};
}

LUCH_FN Vec3 offset_origin(const SurfacePoint& point, Vec3 n_geometric, Vec3 direction) {
    return offset_origin(point.p, point.error, is_zero(point.outward) ? n_geometric : point.outward, direction);
}

}  // namespace luch

// The point that a hit names, how far off it may be, and where the next ray starts.
#pragma once
#include "luch/geometry/ray.h"
#include "luch/math/bounds.h"
#include "luch/math/vec.h"
#include "luch/shade/scene_view.h"

namespace luch {

// p is within error, axis by axis, of the surface as any later ray will meet it (math/bounds.h, 2).
struct SurfacePoint {
    Vec3 p, error;  // world
};

LUCH_FN Vec3 transform_magnitude(const Affine& a, Vec3 magnitude) {
    return {abs_f(a.m[0]) * magnitude.x + abs_f(a.m[1]) * magnitude.y + abs_f(a.m[2]) * magnitude.z,
            abs_f(a.m[4]) * magnitude.x + abs_f(a.m[5]) * magnitude.y + abs_f(a.m[6]) * magnitude.z,
            abs_f(a.m[8]) * magnitude.x + abs_f(a.m[9]) * magnitude.y + abs_f(a.m[10]) * magnitude.z};
}
LUCH_FN Vec3 translation_magnitude(const Affine& a) { return {abs_f(a.m[3]), abs_f(a.m[7]), abs_f(a.m[11])}; }

// The point (1 - u - v) p0 + u p1 + v p2 of an object-space triangle.
LUCH_FN SurfacePoint triangle_point(Vec3 p0, Vec3 p1, Vec3 p2, float u, float v, const Affine& to_world,
                                    const Affine& to_object) {
    float b0 = 1.0f - u - v;
    Vec3 a = b0 * p0, b = u * p1, c = v * p2;
    Vec3 object = a + b + c;
    float extent = max_component(max_v(max_v(abs_v(p0 - object), abs_v(p1 - object)), abs_v(p2 - object)));
    Vec3 object_error = gamma_f(7) * (abs_v(a) + abs_v(b) + abs_v(c)) + make_vec3(gamma_f(7) * extent);

    Vec3 world = transform_point(to_world, object);
    Vec3 back = transform_magnitude(to_object, abs_v(world)) + translation_magnitude(to_object);
    // A flattened instance has no inverse: it is traced in the world, and no ray goes back.
    if (finite_v(back)) object_error += gamma_f(4) * back;
    Vec3 forward = transform_magnitude(to_world, abs_v(object) + make_vec3(extent)) + translation_magnitude(to_world);
    return {world, transform_magnitude(to_world, object_error) + gamma_f(8) * forward};
}

LUCH_FN SurfacePoint surface_point(const SceneView& scene, const Hit& hit) {
    const InstanceView& instance = scene.instances[hit.instance];
    Triangle t = triangle_at(scene, scene.meshes[instance.mesh], hit.prim);
    return triangle_point(t.p[0], t.p[1], t.p[2], hit.u, hit.v, instance.to_world, instance.to_object);
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
    return offset_origin(point.p, point.error, n_geometric, direction);
}

}  // namespace luch

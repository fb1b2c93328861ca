// Emissive triangles of instances, in world space.
#pragma once
#include "luch/light/light.h"
#include "luch/light/polygon.h"

namespace luch {

struct WorldTriangle {
    TriangleCone cone;     // corners relative to the shaded point
    bool sends;            // light towards the shaded point is sampled from this side
};

LUCH_FN_SLOW WorldTriangle make_world_triangle(const SceneView& scene, u32 instance, u32 prim, Vec3 p, float time) {
    InstanceView moved;
    const InstanceView& at = instance_at_time(scene, instance, time, &moved);
    Triangle corners = triangle_at(scene, at, prim, time);
    Affine to_world = at.to_world;
    WorldTriangle t;
    t.cone =
        make_triangle_cone(transform_point(to_world, corners.p[0]) - p, transform_point(to_world, corners.p[1]) - p,
                           transform_point(to_world, corners.p[2]) - p);
    const MaterialView& material = scene.materials[material_at(scene, instance, prim)];
    // Mirrored instances swap the order of corners and with it what make_triangle_cone calls the front.
    bool front = (t.cone.height < 0.0f) != ((at.flags & INSTANCE_MIRRORED) != 0u);
    u32 sides = material.emission_sampling & scene.lights->instances[instance].sides;
    t.sends = t.cone.area > 0.0f && t.cone.height != 0.0f && (sides & (front ? 1u : 2u)) != 0u;
    return t;
}

}  // namespace luch

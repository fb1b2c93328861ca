// Emissive triangles of instances, in world space.
#pragma once
#include "luch/light/light.h"
#include "luch/light/polygon.h"

namespace luch {

struct WorldTriangle {
    TriangleCone cone;     // corners relative to the shaded point
    bool sends;            // light towards the shaded point is sampled from this side
};

LUCH_FN Vec3 load_position(const SceneView& scene, u32 vertex) {
    const float* p = scene.positions + static_cast<u64>(vertex) * 3u;
    return {p[0], p[1], p[2]};
}

LUCH_FN_SLOW WorldTriangle make_world_triangle(const SceneView& scene, u32 instance, u32 prim, Vec3 p) {
    const InstanceView& at = scene.instances[instance];
    const MeshView& mesh = scene.meshes[at.mesh];
    const u32* index = scene.triangles + static_cast<u64>(mesh.first_triangle + prim) * 3u;
    Affine to_world = at.to_world;
    WorldTriangle t;
    t.cone = make_triangle_cone(transform_point(to_world, load_position(scene, mesh.first_vertex + index[0])) - p,
                                transform_point(to_world, load_position(scene, mesh.first_vertex + index[1])) - p,
                                transform_point(to_world, load_position(scene, mesh.first_vertex + index[2])) - p);
    u32 slot = scene.material_slots[mesh.first_triangle + prim];
    u32 last = at.material_count > 0u ? at.material_count - 1u : 0u;
    const MaterialView& material =
        scene.materials[scene.material_table[at.first_material + (slot < last ? slot : last)]];
    // Mirrored instances swap the order of corners and with it what make_triangle_cone calls the front.
    bool front = (t.cone.height < 0.0f) != ((at.flags & INSTANCE_MIRRORED) != 0u);
    u32 sides = material.emission_sampling & scene.lights->instances[instance].sides;
    t.sends = t.cone.area > 0.0f && t.cone.height != 0.0f && (sides & (front ? 1u : 2u)) != 0u;
    return t;
}

}  // namespace luch

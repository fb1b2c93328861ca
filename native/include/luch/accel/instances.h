// Groups of primitives put into the world: what the CPU's scheme (cpu/accel/two_level.h) and the views for any device
// (two_level.h) have in common, so that their hits are the same bit for bit.
#pragma once
#include "luch/geometry/ray.h"
#include "luch/geometry/triangle.h"
#include "luch/math/bounds.h"

namespace luch {

inline constexpr float LARGEST_DISTANCE = 3.402823466e+38f;  // the upper end of a ray that ends nowhere

// Part of a group: primitives of a mesh in its own space, or of one of many instances taken to the world.
struct GroupMember {
    u32 mesh;
    u32 instance;  // NONE: the mesh in its own space
    u32 first_ref;
    u32 first_prim, prim_count;  // of the mesh

    // Refs sort as (instance, prim) do.
    LUCH_FN u32 prim_of(u32 ref) const { return ref - first_ref + first_prim; }
};

// A group as rays find it.
struct alignas(16) GroupEntry {
    Affine to_object;
    u32 group;
    u32 instance;    // NONE: the group is in world space
    u32 visibility;  // RayKind bits
    u32 motion;      // 0: it stands still; else see moving.h
};
static_assert(sizeof(GroupEntry) == 64);

// By how much the entries' boxes must be wider for a ray: what all entries need together.
struct EntryError {
    float scale;  // INSTANCE_ERROR times the largest C
    float size;   // of the scene: the largest coordinate
};
LUCH_FN float widening(const EntryError& error, Vec3 origin) {
    return error.scale * (3.0f * max_component(abs_v(origin)) + error.size);
}

// The ray as an instance's primitives see it, its interval not yet set; false if the transform leaves no ray.
LUCH_FN bool enter_instance(const Affine& to_object, const Ray& ray, Ray* inside) {
    *inside = {transform_point(to_object, ray.origin), 0.0f, transform_direction(to_object, ray.direction),
               LARGEST_DISTANCE};
    return ray_is_valid(*inside);
}

// The member that a ref belongs to; members ascend by first_ref, the first of them at 0.
LUCH_FN const GroupMember& member_of(const GroupMember* members, u32 count, u32 ref) {
    u32 first = 0;
    while (count > 1u) {
        u32 half = count / 2u;
        if (ref >= members[first + half].first_ref) {
            first += half;
            count -= half;
        } else {
            count = half;
        }
    }
    return members[first];
}

// The hit that counts of two: the nearer, on equal t the smaller (instance, prim).
LUCH_FN bool comes_first(const Hit& a, const Hit& b) {
    return a.t < b.t || (a.t == b.t && (a.instance < b.instance || (a.instance == b.instance && a.prim < b.prim)));
}

LUCH_FN Hit no_scene_hit() { return {INFINITE_DISTANCE, NONE, NONE, 0.0f, 0.0f}; }

}  // namespace luch

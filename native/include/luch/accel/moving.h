// Entries that move. An instance's transform is that of the ray's time. A mesh that changes its shape is a group of its
// own kind: for each piece of time between two keys a binary tree, over boxes that hold each triangle all that time; its
// triangles are blended for the ray. So what a ray hits at a time is what it would hit were all of it traced still: the
// same numbers go into the same test.
#pragma once
#include "luch/accel/bvh2.h"
#include "luch/accel/instances.h"
#include "luch/geometry/motion.h"

namespace luch {

// Triangles between two keys. As Primitives, for the walk of a structure.
struct MovingTriangles {
    const float *open, *close;  // nine floats a triangle, by ref: at the piece's ends
    const u8* flags;  // PrimitiveFlag by ref; null: none
    float share;  // of the piece that has passed
};

struct MovingGroup {
    const Bvh2* trees;  // one a piece of time
    const float* corners;  // nine floats a triangle, by ref, key by key; refs are the mesh's triangles
    const u8* flags;
    u32 triangle_count, pieces;
};

// What an entry does while the shutter is open. GroupEntry::motion: its number + 1.
struct EntryMotion {
    InstanceMotion transform;
    u32 group;  // MovingGroup; NONE: keeps its shape
};

struct TraceMotion {
    const EntryMotion* entries;
    const TransformKey* keys;
    const MovingGroup* groups;
};

LUCH_FN MovingTriangles triangles_at(const MovingGroup& group, const MotionPiece& piece) {
    const float* open = group.corners + 9 * u64(group.triangle_count) * piece.key;
    return {open, open + 9 * u64(group.triangle_count), group.flags, piece.share};
}

LUCH_FN Box primitive_box(const MovingTriangles& all, u32 ref) {
    const float *a = all.open + 9 * u64(ref), *b = all.close + 9 * u64(ref);
    Box box = triangle_box(vec3_of(a), vec3_of(a + 3), vec3_of(a + 6));
    extend(box, triangle_box(vec3_of(b), vec3_of(b + 3), vec3_of(b + 6)));
    return box;
}

template <Precision P, class Count>
LUCH_FN bool test_primitive(const MovingTriangles& all, const PrimitiveRay<P>& ray, u32 ref, float t_min, float t_max,
                            TriangleHit* hit, Count& count) {
    const float *a = all.open + 9 * u64(ref), *b = all.close + 9 * u64(ref);
    count.primitive(72);
    Vec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = between(vec3_of(a + 3 * k), vec3_of(b + 3 * k), all.share);
    return ray.triangle(p[0], p[1], p[2], t_min, t_max, hit);
}

// The instance's transform into its own space.
LUCH_FN_SLOW Affine moved_to_object(const TraceMotion& motion, const InstanceMotion& transform, float time) {
    return inverse_of(transform_at(motion.keys, transform, time));
}

// A ray of the scene in an entry that moves, its interval not yet set; false if the transform leaves no ray. Entry: with
// to_object and motion, as GroupEntry has them.
template <class Entry>
LUCH_FN bool enter_moving(const TraceMotion& motion, const Entry& entry, const Ray& ray, float time, Ray* inside) {
    const InstanceMotion& transform = motion.entries[entry.motion - 1u].transform;
    if (transform.key_count == 0u) return enter_instance(entry.to_object, ray, inside);
    return enter_instance(moved_to_object(motion, transform, time), ray, inside);
}

// The group that changes its shape, if the entry's does.
template <class Entry>
LUCH_FN const MovingGroup* moving_group(const TraceMotion& motion, const Entry& entry) {
    u32 group = motion.entries[entry.motion - 1u].group;
    return group == NONE ? nullptr : motion.groups + group;
}

template <Precision P, class Count>
LUCH_FN void closest_hit(const MovingGroup& group, const Ray& ray, float time, RefHit* best, Count& count) {
    MotionPiece piece = motion_piece(group.pieces + 1u, time);
    closest_hit<P>(group.trees[piece.key], triangles_at(group, piece), ray, best, count);
}
template <Precision P, class Count>
LUCH_FN u8 any_hit(const MovingGroup& group, const Ray& ray, float time, Count& count) {
    MotionPiece piece = motion_piece(group.pieces + 1u, time);
    return any_hit<P>(group.trees[piece.key], triangles_at(group, piece), ray, count);
}

}  // namespace luch

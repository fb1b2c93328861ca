// Entries that move. An instance's transform is that of the ray's time. A mesh that changes its shape is a group of its
// own kind: for each piece of time between two keys a binary tree, over boxes that hold each triangle, or piece of hair,
// all that time; those are blended for the ray. So what a ray hits at a time is what it would hit were all of it traced still: the
// same numbers go into the same test.
#pragma once
#include "luch/accel/bvh2.h"
#include "luch/accel/instances.h"
#include "luch/geometry/motion.h"

namespace luch {

// Triangles or hair between two keys. As Primitives, for the walk of a structure.
struct MovingPrimitives {
    const float *open, *close;  // rows of MovingGroup at the ends of the piece of time
    const u8* flags;  // PrimitiveFlag by ref; null: none
    float share;  // of that time that has passed
    CurveSet curves;  // those at its beginning; without segments where these are triangles
};

struct MovingGroup {
    const Bvh2* trees;  // one a piece of time
    const float* rows;  // key by key; of triangles nine floats each, by ref, of hair four a point
    const u8* flags;
    u64 stride;  // floats of a key
    u32 pieces;  // of time
    CurveSet curves;  // as of MovingPrimitives, its points those of the first key
};

// What an entry does while the shutter is open. GroupEntry::motion: its number + 1.
struct EntryMotion {
    InstanceMotion transform;
    u32 group;  // MovingGroup; NONE: keeps its shape
};

struct TraceMotion {
    const EntryMotion* entries;
    const TransformKey* keys;
    const Slide* slides;
    const MovingGroup* groups;
};

LUCH_FN MovingPrimitives primitives_at(const MovingGroup& group, const MotionPiece& piece) {
    const float* open = group.rows + group.stride * piece.key;
    MovingPrimitives all = {open, open + group.stride, group.flags, piece.share, group.curves};
    all.curves.points = open;
    return all;
}
LUCH_FN bool are_curves(const MovingPrimitives& all) { return plan::CURVES && all.curves.segment_count != 0u; }

// All that a capsule needs (its ends, its radius, what rounding adds) is convex in time, so the boxes at the ends hold
// what lies between.
LUCH_FN Box moving_piece_box(const MovingPrimitives& all, u32 piece) {
    CurveSet later = all.curves;
    later.points = all.close;
    Box box = capsule_box(piece_capsule(all.curves, piece));
    extend(box, capsule_box(piece_capsule(later, piece)));
    return box;
}
LUCH_FN Box primitive_box(const MovingPrimitives& all, u32 ref) {
    if (are_curves(all)) return moving_piece_box(all, ref);
    const float *a = all.open + 9 * u64(ref), *b = all.close + 9 * u64(ref);
    Box box = triangle_box(vec3_of(a), vec3_of(a + 3), vec3_of(a + 6));
    extend(box, triangle_box(vec3_of(b), vec3_of(b + 3), vec3_of(b + 6)));
    return box;
}

template <Precision P, class Count>
LUCH_FN bool test_primitive(const MovingPrimitives& all, const PrimitiveRay<P>& ray, u32 ref, float t_min, float t_max,
                            TriangleHit* hit, Count& count) {
    if (are_curves(all)) {
        count.primitive(132);
        return test_moving_piece<P>(all.curves, all.close, all.share, ref, ray.origin, ray.direction, t_min, t_max,
                                    hit);
    }
    const float *a = all.open + 9 * u64(ref), *b = all.close + 9 * u64(ref);
    count.primitive(72);
    Vec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = between(vec3_of(a + 3 * k), vec3_of(b + 3 * k), all.share);
    return ray.triangle(p[0], p[1], p[2], t_min, t_max, hit);
}

// The instance's transform into its own space.
LUCH_FN_SLOW Affine moved_to_object(const TraceMotion& motion, const InstanceMotion& transform, float time) {
    return to_object_at(motion.keys, motion.slides, transform, time);
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
    closest_hit<P>(group.trees[piece.key], primitives_at(group, piece), ray, best, count);
}
template <Precision P, class Count>
LUCH_FN u8 any_hit(const MovingGroup& group, const Ray& ray, float time, Count& count) {
    MotionPiece piece = motion_piece(group.pieces + 1u, time);
    return any_hit<P>(group.trees[piece.key], primitives_at(group, piece), ray, count);
}

}  // namespace luch

// What every structure is built over: triangles, spheres, pieces of curves of one space, numbered by *ref*. Refs sort as the
// caller's (instance, primitive) do, so that on equal t the smaller ref wins. Structures store refs and call
// `test_primitive`; the test alone decides what is hit, so the structure cannot change a picture.
#pragma once
#include "luch/geometry/box.h"
#include "luch/geometry/curve_test.h"
#include "luch/geometry/precision.h"
#include "luch/geometry/ray.h"
#include "luch/geometry/sphere.h"
#include "luch/geometry/triangle.h"
#include "luch/geometry/triangle_tests.h"
#include "luch/plan.h"

namespace luch {

struct Primitives {
    const float* corners;  // nine floats a triangle: p0, p1, p2; by ref
    const float* spheres;  // four floats a sphere: centre, radius (see Sphere); by ref - triangle_count
    const u8* flags;  // PrimitiveFlag by ref; null: none
    u32 triangle_count, sphere_count;
    CurveSet curves;  // by ref - triangle_count - sphere_count
};
LUCH_FN bool is_piece(const Primitives& all, u32 ref) {
    return plan::CURVES && ref >= all.triangle_count + all.sphere_count;
}
LUCH_FN u32 piece_of(const Primitives& all, u32 ref) { return ref - all.triangle_count - all.sphere_count; }

enum PrimitiveFlag : u8 { PRIMITIVE_MAY_BE_TRANSPARENT = 1 };
enum Blocked : u8 { BLOCKED_NOT = 0, BLOCKED_OPAQUE = 1, BLOCKED_MAYBE = 2 };

struct RefHit {
    float t;  // before a hit: the upper end of the ray's interval
    u32 ref;  // NONE: nothing yet; a hit at exactly t then still counts
    float u, v;
};

// What a traversal did. Kernels without counters take NoCounters, whose calls are nothing.
struct Counters {
    u64 nodes = 0;  // inner nodes or cells visited
    u64 boxes = 0;  // boxes or split planes compared with the ray
    u64 primitives = 0;  // primitive tests
    u64 bytes = 0;  // of nodes, lists and primitives read
    LUCH_FN void node(u32 size, u32 box_count) {
        ++nodes;
        boxes += box_count;
        bytes += size;
    }
    LUCH_FN void primitive(u32 size) {
        ++primitives;
        bytes += size;
    }
    LUCH_FN void list(u32 size) { bytes += size; }
    LUCH_FN void add(const Counters& other) {
        nodes += other.nodes;
        boxes += other.boxes;
        primitives += other.primitives;
        bytes += other.bytes;
    }
};
struct NoCounters {
    LUCH_FN void node(u32, u32) {}
    LUCH_FN void primitive(u32) {}
    LUCH_FN void list(u32) {}
};

// A ray prepared for one precision's primitive test.
template <Precision P>
struct PrimitiveRay;
template <>
struct PrimitiveRay<Precision::FAST> {
    Vec3 origin, direction;
    LUCH_FN explicit PrimitiveRay(const Ray& ray) : origin(ray.origin), direction(ray.direction) {}
    LUCH_FN bool triangle(Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max, TriangleHit* hit) const {
        return intersect_triangle_barycentric(origin, direction, p0, p1, p2, t_min, t_max, hit);
    }
};
template <>
struct PrimitiveRay<Precision::WATERTIGHT> {
    Vec3 origin, direction;
    TriangleRay sheared;
    LUCH_FN explicit PrimitiveRay(const Ray& ray)
        : origin(ray.origin), direction(ray.direction), sheared(make_triangle_ray(ray.origin, ray.direction)) {}
    LUCH_FN bool triangle(Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max, TriangleHit* hit) const {
        return intersect_triangle(sheared, p0, p1, p2, t_min, t_max, hit);
    }
};
template <>
struct PrimitiveRay<Precision::DOUBLE> {
    Vec3 origin, direction;
    LUCH_FN explicit PrimitiveRay(const Ray& ray) : origin(ray.origin), direction(ray.direction) {}
    LUCH_FN bool triangle(Vec3 p0, Vec3 p1, Vec3 p2, float t_min, float t_max, TriangleHit* hit) const {
        return intersect_triangle_double(origin, direction, p0, p1, p2, t_min, t_max, hit);
    }
};

LUCH_FN Vec3 vec3_of(const float* p) { return {p[0], p[1], p[2]}; }

// Not inlined: the code of triangles and spheres beside it keeps its registers.
template <Precision P>
LUCH_FN_APART bool test_piece(const CurveSet& set, u32 piece, Vec3 origin, Vec3 direction, float t_min, float t_max,
                              TriangleHit* hit) {
    auto ray = make_curve_ray<typename CurveNumber<P>::Type>(origin, direction);
    return intersect_piece(set, piece, ray, t_min, t_max, hit);
}

// The same of hair that changes its shape; set: its curves at the key before, later: the points of the next.
template <Precision P>
LUCH_FN_APART bool test_moving_piece(const CurveSet& set, const float* later, float share, u32 piece, Vec3 origin,
                                     Vec3 direction, float t_min, float t_max, TriangleHit* hit) {
    auto ray = make_curve_ray<typename CurveNumber<P>::Type>(origin, direction);
    return intersect_piece_of(segment_between(set, later, piece, share), set, piece, ray, t_min, t_max, hit);
}

template <Precision P, class Count>
LUCH_FN bool test_primitive(const Primitives& all, const PrimitiveRay<P>& ray, u32 ref, float t_min, float t_max,
                            TriangleHit* hit, Count& count) {
    if (!(plan::SPHERES || plan::CURVES) || ref < all.triangle_count) {
        const float* p = all.corners + 9 * u64(ref);
        count.primitive(36);
        return ray.triangle(vec3_of(p), vec3_of(p + 3), vec3_of(p + 6), t_min, t_max, hit);
    }
    if (plan::CURVES && (!plan::SPHERES || is_piece(all, ref))) {
        count.primitive(68);
        return test_piece<P>(all.curves, piece_of(all, ref), ray.origin, ray.direction, t_min, t_max, hit);
    }
    const float* s = all.spheres + 4 * u64(ref - all.triangle_count);
    count.primitive(16);
    hit->u = hit->v = 0.0f;
    return intersect_sphere<P>(ray.origin, ray.direction, {vec3_of(s), s[3]}, t_min, t_max, &hit->t);
}

// The box that a structure must put the primitive in: every hit of the ray's cone (math/bounds.h, 1) lies in it.
LUCH_FN Box primitive_box(const Primitives& all, u32 ref) {
    if (ref < all.triangle_count) {
        const float* p = all.corners + 9 * u64(ref);
        return triangle_box(vec3_of(p), vec3_of(p + 3), vec3_of(p + 6));
    }
    if (is_piece(all, ref)) return capsule_box(piece_capsule(all.curves, piece_of(all, ref)));
    const float* s = all.spheres + 4 * u64(ref - all.triangle_count);
    return sphere_box(vec3_of(s), s[3]);
}

LUCH_FN bool is_closer(float t, u32 ref, const RefHit& best) { return t < best.t || (t == best.t && ref < best.ref); }

// Tests one primitive and keeps it if it is the better hit. All: Primitives, or those that move (moving.h).
template <Precision P, class All, class Count>
LUCH_FN void offer_primitive(const All& all, const PrimitiveRay<P>& ray, u32 ref, float t_min, RefHit* best,
                             Count& count) {
    TriangleHit hit;
    if (test_primitive(all, ray, ref, t_min, best->t, &hit, count) && is_closer(hit.t, ref, *best))
        *best = {hit.t, ref, hit.u, hit.v};
}

// Tests one primitive for a shadow ray; true when nothing else can matter.
template <Precision P, class All, class Count>
LUCH_FN bool block_primitive(const All& all, const PrimitiveRay<P>& ray, u32 ref, float t_min, float t_max, u8* blocked,
                             Count& count) {
    TriangleHit hit;
    if (!test_primitive(all, ray, ref, t_min, t_max, &hit, count)) return false;
    bool maybe = all.flags && (all.flags[ref] & PRIMITIVE_MAY_BE_TRANSPARENT);
    *blocked = maybe ? u8(BLOCKED_MAYBE) : u8(BLOCKED_OPAQUE);
    return !maybe;
}

}  // namespace luch

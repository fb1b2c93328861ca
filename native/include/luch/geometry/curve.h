// Hair: curves through points with a radius each. A segment is the uniform Catmull-Rom cubic between two neighbouring
// points (Catmull, Rom 1974); at a curve's ends the last point stands for the missing one. A segment is cut into
// pieces of equal parameter, and a piece is a primitive: long thin segments lie badly in boxes of any structure.
#pragma once
#include "luch/geometry/box.h"
#include "luch/geometry/motion.h"
#include "luch/geometry/precision.h"
#include "luch/geometry/ray.h"
#include "luch/math/bounds.h"
#include "luch/plan.h"

namespace luch {

enum class CurveShape : u32 {
    RIBBON,        // flat, turned to the ray about the curve, shaded as if round
    THICK,         // round, open at both ends; only the outside is there
    THICK_LINEAR,  // straight cones between points, balls at the joints and ends; only the outside is there
};

// What curves look like; told: as the scene says it.
LUCH_FN CurveShape look_of(CurveShape told) {
    return plan::CURVE_SHAPE == plan::ANY_CURVE_SHAPE ? told : CurveShape(plan::CURVE_SHAPE);
}

enum SegmentFlag : u32 { SEGMENT_HAS_BEFORE = 1, SEGMENT_HAS_AFTER = 2 };

// The curves of one mesh, in its own space.
struct CurveSet {
    const float* points;    // four floats each: place, radius
    const u32* segments;    // number of its first point << 2 | SegmentFlag
    u32 segment_count;
    u32 log2_pieces;        // of a segment
    CurveShape shape;
    u32 unused;
};
// Ribbons are straight in each piece, 16 of a segment at most, as in Cycles; round curves are cut for their boxes alone.
LUCH_FN u32 log2_pieces_of(CurveShape shape, u32 subdivisions) {
    return shape == CurveShape::RIBBON ? (subdivisions < 4u ? subdivisions : 4u) : shape == CurveShape::THICK ? 2u : 0u;
}
LUCH_FN u32 piece_count(const CurveSet& set) { return set.segment_count << set.log2_pieces; }

struct CurvePoint {
    Vec3 p;
    float radius;
};
struct CurveSegment {
    CurvePoint k[4];  // the curve goes from k[1] to k[2]
};

LUCH_FN CurvePoint curve_point_at(const float* points, u32 index) {
    const float* p = points + 4 * u64(index);
    return {{p[0], p[1], p[2]}, p[3]};
}
LUCH_FN CurveSegment load_segment(const float* points, u32 word) {
    u32 first = word >> 2;
    CurvePoint a = curve_point_at(points, first), b = curve_point_at(points, first + 1u);
    return {{word & SEGMENT_HAS_BEFORE ? curve_point_at(points, first - 1u) : a, a, b,
             word & SEGMENT_HAS_AFTER ? curve_point_at(points, first + 2u) : b}};
}
LUCH_FN CurveSegment segment_of_piece(const CurveSet& set, u32 piece) {
    return load_segment(set.points, set.segments[piece >> set.log2_pieces]);
}
// Of hair that changes its shape: points of the same segments at a later key, `share` of the way to them.
LUCH_FN CurveSegment segment_between(const CurveSet& set, const float* later, u32 piece, float share) {
    u32 word = set.segments[piece >> set.log2_pieces];
    CurveSegment a = load_segment(set.points, word), b = load_segment(later, word);
    for (int i = 0; i < 4; ++i)
        a.k[i] = {between(a.k[i].p, b.k[i].p, share), between(a.k[i].radius, b.k[i].radius, share)};
    return a;
}

// The part of its segment that a piece is; exact, so that neighbours end where the next begins.
struct PieceRange {
    float from, to;
};
LUCH_FN PieceRange range_of_piece(u32 log2_pieces, u32 piece) {
    u32 pieces = 1u << log2_pieces, number = piece & (pieces - 1u);
    float step = 1.0f / float(pieces);
    return {float(number) * step, float(number + 1u) * step};
}

// Weights of the four points at u, and of the tangent; at 0 and 1 exactly k[1] and k[2].
struct CurveWeights {
    float w[4];
};
LUCH_FN CurveWeights curve_weights(float u) {
    float s = 1.0f - u;
    return {{-0.5f * u * s * s, 1.0f + 0.5f * u * u * (3.0f * u - 5.0f), 1.0f + 0.5f * s * s * (3.0f * s - 5.0f),
             -0.5f * s * u * u}};
}
LUCH_FN CurveWeights tangent_weights(float u) {
    float s = 1.0f - u;
    return {{s * u - 0.5f * s * s, u * (4.5f * u - 5.0f), s * (5.0f - 4.5f * s), 0.5f * u * u - s * u}};
}
LUCH_FN CurveWeights bend_weights(float u) {  // of the second derivative
    return {{2.0f - 3.0f * u, 9.0f * u - 5.0f, 4.0f - 9.0f * u, 3.0f * u - 1.0f}};
}
LUCH_FN Vec3 place_of(const CurveSegment& s, const CurveWeights& w) {
    return s.k[0].p * w.w[0] + s.k[1].p * w.w[1] + s.k[2].p * w.w[2] + s.k[3].p * w.w[3];
}
LUCH_FN float radius_of(const CurveSegment& s, const CurveWeights& w) {
    float r = s.k[0].radius * w.w[0] + s.k[1].radius * w.w[1] + s.k[2].radius * w.w[2] + s.k[3].radius * w.w[3];
    return max_f(r, 0.0f);
}
// Along the curve at u, not unit; where the curve stands still, along its chord.
LUCH_FN Vec3 curve_tangent(const CurveSegment& s, CurveShape shape, float u) {
    Vec3 chord = s.k[2].p - s.k[1].p;
    if (look_of(shape) == CurveShape::THICK_LINEAR) return chord;
    Vec3 t = place_of(s, tangent_weights(u));
    return length_squared(t) > 0.0f ? t : chord;
}

// A capsule that holds a piece: all within `radius` of the line from a to b.
struct Capsule {
    Vec3 a, b;
    float radius;
};

// Widened by what the tests may stray: their points are taken relative to the segment, which rounds at its size; here
// they are found in the mesh's space, which rounds at that of its coordinates; and by the ray's cone (math/bounds.h, 1).
LUCH_FN Capsule widened(Capsule c, const CurveSegment& s) {
    float size = 0.0f, place = 0.0f;
    for (int i = 0; i < 4; ++i) {
        size = max_f(size, max_component(abs_v(s.k[i].p - s.k[1].p)));
        place = max_f(place, max_component(abs_v(s.k[i].p)));
    }
    float error = CURVE_SIZE_ERROR * (size + c.radius) + CURVE_PLACE_ERROR * place +
                  (THICK_TOLERANCE + PLANE_TOLERANCE) * c.radius;
    c.radius = above(c.radius + error) + DENORMAL_SLACK;
    return c;
}
LUCH_FN float distance_to_line(Vec3 p, Vec3 a, Vec3 b) {
    Vec3 e = b - a, m = p - a;
    float along = clamp_f(safe_divide(dot(m, e), dot(e, e)), 0.0f, 1.0f);
    return length(m - e * along);
}
LUCH_FN_SLOW Capsule piece_capsule(const CurveSet& set, u32 piece) {
    CurveSegment s = segment_of_piece(set, piece);
    PieceRange range = range_of_piece(set.log2_pieces, piece);
    if (look_of(set.shape) == CurveShape::THICK_LINEAR)
        return widened({s.k[1].p, s.k[2].p, max_f(s.k[1].radius, s.k[2].radius)}, s);
    CurveWeights from = curve_weights(range.from), to = curve_weights(range.to);
    Capsule c = {place_of(s, from), place_of(s, to), max_f(radius_of(s, from), radius_of(s, to))};
    if (look_of(set.shape) == CurveShape::THICK) {
        // Bezier's points of the piece hold it (Bezier 1972); the inner two stray from the chord.
        CurveWeights t0 = tangent_weights(range.from), t1 = tangent_weights(range.to);
        float third = (range.to - range.from) * (1.0f / 3.0f);
        Vec3 p1 = c.a + place_of(s, t0) * third, p2 = c.b - place_of(s, t1) * third;
        float r1 = 0.0f, r2 = 0.0f;
        for (int i = 0; i < 4; ++i) {
            r1 += s.k[i].radius * (from.w[i] + t0.w[i] * third);
            r2 += s.k[i].radius * (to.w[i] - t1.w[i] * third);
        }
        c.radius =
            max_f(c.radius, max_f(r1, r2)) + max_f(distance_to_line(p1, c.a, c.b), distance_to_line(p2, c.a, c.b));
    }
    return widened(c, s);
}
LUCH_FN Box capsule_box(const Capsule& c) {
    // The cone's half width at the piece's size, as for a triangle.
    float r = c.radius + SHEAR_ERROR * (max_component(abs_v(c.b - c.a)) + c.radius);
    Vec3 lo = min_v(c.a, c.b), hi = max_v(c.a, c.b);
    return {{below(lo.x - r), below(lo.y - r), below(lo.z - r)}, {above(hi.x + r), above(hi.y + r), above(hi.z + r)}};
}

// What every builder leaves out: points that are not finite, pieces without a radius.
LUCH_FN bool piece_is_finite(const CurveSet& set, u32 piece) {
    CurveSegment s = segment_of_piece(set, piece);
    for (int i = 0; i < 4; ++i)
        if (!point_can_be_traced(s.k[i].p) || !(abs_f(s.k[i].radius) <= LARGEST_COORDINATE)) return false;
    return finite_f(piece_capsule(set, piece).radius);
}
LUCH_FN bool piece_has_radius(const CurveSet& set, u32 piece) {
    CurveSegment s = segment_of_piece(set, piece);
    PieceRange range = range_of_piece(set.log2_pieces, piece);
    bool cubic = look_of(set.shape) != CurveShape::THICK_LINEAR;
    float from = cubic ? radius_of(s, curve_weights(range.from)) : s.k[1].radius;
    float to = cubic ? radius_of(s, curve_weights(range.to)) : s.k[2].radius;
    return max_f(from, to) > 0.0f;
}
LUCH_FN bool piece_can_be_traced(const CurveSet& set, u32 piece) {
    return piece_is_finite(set, piece) && piece_has_radius(set, piece);
}

}  // namespace luch

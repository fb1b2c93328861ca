// A ray against a piece of a curve (geometry/curve.h). The segment's points are taken relative to the ray: the place of
// one of them is found in double (in single where speed is asked for), the others follow by their differences, so that a
// hair far away keeps its digits. There the ray is the z axis, and its unit of length is the scene's, not its own.
#pragma once
#include "luch/geometry/curve.h"
#include "luch/geometry/triangle.h"
#include "luch/math/bounds.h"

namespace luch {

template <Precision P>
struct CurveNumber {
    using Type = double;
};
template <>
struct CurveNumber<Precision::FAST> {
    using Type = float;
};

// A ray prepared for the test.
template <class F>
struct CurveRay {
    Vec3 origin, direction;
    Vec3 x, y, unit;  // orthonormal, right-handed
    float length;  // of the direction
    F inverse_square;
};
template <class F>
LUCH_FN CurveRay<F> make_curve_ray(Vec3 origin, Vec3 direction) {
    CurveRay<F> ray;
    ray.origin = origin;
    ray.direction = direction;
    ray.length = length(direction);
    ray.unit = direction / ray.length;
    make_frame(ray.unit, &ray.x, &ray.y);
    F dx = F(direction.x), dy = F(direction.y), dz = F(direction.z);
    ray.inverse_square = F(1) / (dx * dx + dy * dy + dz * dz);
    return ray;
}

// A segment beside the ray; t of the ray is that of z = 0.
template <class F>
struct RaySegment {
    CurveSegment s;  // places in the ray's frame
    F t;
};
template <class F>
LUCH_FN RaySegment<F> to_ray(const CurveSegment& s, const CurveRay<F>& ray) {
    Vec3 p = s.k[1].p, o = ray.origin, d = ray.direction;
    F fx = F(p.x) - F(o.x), fy = F(p.y) - F(o.y), fz = F(p.z) - F(o.z);
    RaySegment<F> out;
    out.t = (fx * F(d.x) + fy * F(d.y) + fz * F(d.z)) * ray.inverse_square;
    Vec3 q = {float(fx - out.t * F(d.x)), float(fy - out.t * F(d.y)), float(fz - out.t * F(d.z))};
    Vec3 base = {dot(q, ray.x), dot(q, ray.y), dot(q, ray.unit)};
    for (int i = 0; i < 4; ++i) {
        Vec3 e = s.k[i].p - p;
        out.s.k[i] = {base + make_vec3(dot(e, ray.x), dot(e, ray.y), dot(e, ray.unit)), s.k[i].radius};
    }
    return out;
}

// Accepts a hit at z along the ray.
template <class F>
LUCH_FN bool accept_curve_hit(const CurveRay<F>& ray, F t, float z, float t_min, float t_max, TriangleHit* hit) {
    hit->t = float(t + F(z / ray.length));
    return hit->t > t_min && hit->t <= t_max;  // NaN: miss
}

// ---- ribbons ----------------------------------------------------------------------------------------------------

// Twice the signed area of the ray's axis, p and q.
LUCH_FN float turn(Vec2 p, Vec2 q) { return p.x * q.y - p.y * q.x; }

// An end of a piece's quadrilateral: across the curve as the ray sees it, a radius to each side. chord: of the piece,
// taken where the tangent looks along the ray.
LUCH_FN Vec2 ribbon_side(Vec3 tangent, Vec3 chord, float radius) {
    float length2 = tangent.x * tangent.x + tangent.y * tangent.y;
    if (!(length2 > sqr(RIBBON_ALONG_SINE) * tangent.z * tangent.z)) {
        tangent = chord;
        length2 = tangent.x * tangent.x + tangent.y * tangent.y;
    }
    float scale = length2 > 0.0f ? radius / sqrt_f(length2) : 0.0f;
    return {tangent.y * scale, -tangent.x * scale};
}

// Whether the ray begins within the straight round curve whose axis goes through a.
template <class F>
LUCH_FN bool starts_within(const CurveRay<F>& ray, F t, Vec3 a, Vec3 chord, float radius) {
    Vec3 m = {-a.x, -a.y, float(-t) * ray.length - a.z}, across = cross(m, chord);
    return dot(across, across) <= sqr(RIBBON_WITHIN_RADII * radius) * dot(chord, chord);
}

// hit: u along the segment, v from -1 to 1 across, towards cross(tangent, -direction).
template <class F>
LUCH_FN bool intersect_ribbon(const CurveSegment& segment, PieceRange range, const CurveRay<F>& ray, float t_min,
                              float t_max, TriangleHit* hit) {
    RaySegment<F> r = to_ray(segment, ray);
    CurveWeights from = curve_weights(range.from), to = curve_weights(range.to);
    Vec3 a = place_of(r.s, from), b = place_of(r.s, to), chord = b - a;
    float radius_a = radius_of(r.s, from), radius_b = radius_of(r.s, to), reach = max_f(radius_a, radius_b);
    float far = turn({chord.x, chord.y}, {a.x, a.y});
    float length2 = chord.x * chord.x + chord.y * chord.y;
    if (!(far * far <= reach * reach * length2)) return false;  // beside the axis by more than the radius
    Vec2 side_a = ribbon_side(place_of(r.s, tangent_weights(range.from)), chord, radius_a);
    Vec2 side_b = ribbon_side(place_of(r.s, tangent_weights(range.to)), chord, radius_b);
    Vec2 a0 = {a.x + side_a.x, a.y + side_a.y}, a1 = {a.x - side_a.x, a.y - side_a.y};
    Vec2 b0 = {b.x + side_b.x, b.y + side_b.y}, b1 = {b.x - side_b.x, b.y - side_b.y};
    // Triangles a0 b0 a1 and b1 a1 b0.
    float along, across, diagonal = turn(b0, a1), e0 = turn(a0, b0), e2 = turn(a1, a0);
    float area = e0 + diagonal + e2;
    if ((e0 >= 0.0f && diagonal >= 0.0f && e2 >= 0.0f) || (e0 <= 0.0f && diagonal <= 0.0f && e2 <= 0.0f)) {
        if (area == 0.0f) return false;
        along = e2 / area;
        across = e0 / area;
    } else {
        e0 = turn(b1, a1);
        e2 = turn(b0, b1);
        area = e0 - diagonal + e2;
        if (!((e0 >= 0.0f && diagonal <= 0.0f && e2 >= 0.0f) || (e0 <= 0.0f && diagonal >= 0.0f && e2 <= 0.0f)))
            return false;
        if (area == 0.0f) return false;
        along = 1.0f - e2 / area;
        across = 1.0f - e0 / area;
    }
    along = saturate_f(along);
    if (!accept_curve_hit(ray, r.t, a.z + along * chord.z, t_min, t_max, hit)) return false;
    hit->u = range.from + along * (range.to - range.from);
    hit->v = clamp_f(2.0f * across - 1.0f, -1.0f, 1.0f);
    return hit->t * ray.length > RIBBON_START_RADII * mix_f(radius_a, radius_b, along) &&
           !starts_within(ray, r.t, a, chord, reach);
}

// ---- round curves -----------------------------------------------------------------------------------------------

// How far the ray's point at z is from the round curve, and at which u: the curve's circle whose plane holds the point.
struct CurveDistance {
    float distance, u;
    float beside2;  // how far the point is from that plane, squared: where Newton's steps have not arrived
};
LUCH_FN CurveDistance distance_to_curve(const CurveSegment& s, float z, float u) {
    constexpr int STEPS = 3;  // Newton's; a piece is nearly straight
    Vec3 m = {};
    CurveWeights w = curve_weights(u);
    for (int step = 0; step <= STEPS; ++step) {
        m = make_vec3(0.0f, 0.0f, z) - place_of(s, w);
        Vec3 tangent = place_of(s, tangent_weights(u));
        float f = dot(m, tangent), square = dot(tangent, tangent),
              slope = square - dot(m, place_of(s, bend_weights(u)));
        if (!(slope > 0.25f * square)) slope = square;  // bent more sharply than it is thick, or standing still
        if (step == STEPS || !(slope > 0.0f)) {
            // What is left of m along the tangent is no distance.
            float rest = square > 0.0f ? f * f / square : 0.0f;
            return {safe_sqrt(dot(m, m) - rest) - radius_of(s, w), u, rest};
        }
        u = clamp_f(u + f / slope, -0.5f, 1.5f);
        w = curve_weights(u);
    }
    return {INFINITE_DISTANCE, u, INFINITE_DISTANCE};
}

// Between z_out, outside the curve, and z_in, within it: where its surface is, by regula falsi that halves the weight of
// an end that stays (Illinois; Dowell, Jarratt 1971).
LUCH_FN bool find_curve_surface(const CurveSegment& s, float z_out, CurveDistance out, float z_in, CurveDistance in,
                                float* z, float* u) {
    constexpr int STEPS = 24;
    float d_out = out.distance, d_in = in.distance;
    *u = in.u;
    for (int step = 0; step < STEPS; ++step) {
        *z = z_out + (z_in - z_out) * (d_out / (d_out - d_in));
        CurveDistance here = distance_to_curve(s, *z, *u);
        *u = here.u;
        float radius = radius_of(s, curve_weights(here.u));
        if (abs_f(here.distance) <= 0.25f * THICK_TOLERANCE * radius || *z == z_out || *z == z_in)
            return here.beside2 <= sqr(PLANE_TOLERANCE * radius);
        if (here.distance > 0.0f) {
            z_out = *z;
            d_out = here.distance;
            d_in *= 0.5f;
        } else {
            z_in = *z;
            d_in = here.distance;
            d_out *= 0.5f;
        }
    }
    return false;
}

// hit: u along the segment, v 0.
template <class F>
LUCH_FN bool intersect_thick(const CurveSegment& segment, PieceRange range, const CurveRay<F>& ray, float t_min,
                             float t_max, TriangleHit* hit) {
    RaySegment<F> r = to_ray(segment, ray);
    CurveWeights from = curve_weights(range.from), to = curve_weights(range.to);
    Vec3 a = place_of(r.s, from), b = place_of(r.s, to), chord = b - a;
    float flat2 = chord.x * chord.x + chord.y * chord.y, length2 = flat2 + chord.z * chord.z;
    // Along the curve: it would be entered through an end, which is open.
    if (!(flat2 > CURVE_ALONG_SINE2 * length2)) return false;
    float share = -(a.x * chord.x + a.y * chord.y) / flat2;  // of the chord, where the two lines are nearest
    float middle = a.z + share * chord.z, width = range.to - range.from;
    // Here the ray is as near to the axis as it comes; without the ends, which may cut that off.
    CurveDistance in = distance_to_curve(r.s, middle, range.from + clamp_f(share, -1.0f, 2.0f) * width);
    float radius = max_f(radius_of(r.s, from), radius_of(r.s, to));
    // A bent curve is nearest elsewhere: look once more where its own tangent says.
    Vec3 at = place_of(r.s, curve_weights(in.u)), tangent = place_of(r.s, tangent_weights(in.u));
    float flat = tangent.x * tangent.x + tangent.y * tangent.y;
    if (flat > CURVE_ALONG_SINE2 * (flat + tangent.z * tangent.z)) {
        float nearer = at.z - (at.x * tangent.x + at.y * tangent.y) / flat * tangent.z;
        CurveDistance second = distance_to_curve(r.s, nearer, in.u);
        if (second.distance < in.distance) {
            in = second;
            middle = nearer;
        }
    }
    if (!(in.distance <= 0.0f)) return false;
    // Out by twice what a straight cylinder would need, farther where that is not enough.
    float step = 2.0f * radius * sqrt_f(length2 / flat2), z_out = middle;
    CurveDistance out = in;
    for (int tries = 0; tries < 4 && !(out.distance > 0.0f); ++tries, step *= 2.0f) {
        z_out = middle - step;
        out = distance_to_curve(r.s, z_out, clamp_f(in.u - step * chord.z / length2 * width, -0.5f, 1.5f));
    }
    if (!(out.distance > 0.0f)) return false;
    float z, u;
    if (!find_curve_surface(r.s, z_out, out, middle, in, &z, &u) || !(u >= range.from && u <= range.to)) return false;
    hit->u = u;
    hit->v = 0.0f;
    return accept_curve_hit(ray, r.t, z, t_min, t_max, hit);
}

// ---- straight cones ---------------------------------------------------------------------------------------------

// Where the z axis enters a ball; false: it does not.
LUCH_FN bool enter_ball(Vec3 center, float radius, float* z) {
    float inside = radius * radius - (center.x * center.x + center.y * center.y);
    *z = center.z - safe_sqrt(inside);
    return inside >= 0.0f && radius > 0.0f;
}

// The cone that touches both ends' balls, and the balls; what lies within the next cone does not count.
template <class F>
LUCH_FN bool intersect_linear(const CurveSegment& segment, const CurveRay<F>& ray, float t_min, float t_max,
                              TriangleHit* hit) {
    RaySegment<F> r = to_ray(segment, ray);
    Vec3 a = r.s.k[1].p, b = r.s.k[2].p, e = b - a;
    float ra = r.s.k[1].radius, rb = r.s.k[2].radius, dr = rb - ra, length2 = dot(e, e);
    float g = length2 - dr * dr;  // <= 0: one ball holds the other
    auto height = [&](float z) {
        return dot(make_vec3(0.0f, 0.0f, z) - a, e) + ra * dr;
    };  // in [0, g]: beside the cone
    float best = INFINITE_DISTANCE, z;
    hit->u = hit->v = 0.0f;
    float k = -dot(a, e), qa = g - e.z * e.z, qb = -g * a.z - e.z * (k + ra * dr);
    float qc = g * dot(a, a) - k * k - ra * ra * length2 - 2.0f * ra * dr * k;
    float discriminant = qb * qb - qa * qc;
    if (g > 0.0f && qa > 0.0f && discriminant >= 0.0f) {
        z = (-qb - sqrt_f(discriminant)) / qa;
        float y = height(z);
        if (y >= 0.0f && y <= g) {
            best = z;
            hit->u = y / g;
        }
    }
    Vec3 next = r.s.k[3].p - b, before = a - r.s.k[0].p;
    if (enter_ball(b, rb, &z) && z < best && (height(z) > g || !(g > 0.0f)) &&
        !(dot(make_vec3(0.0f, 0.0f, z) - b, next) > -rb * (r.s.k[3].radius - rb))) {
        best = z;
        hit->u = 1.0f;
    }
    if (is_zero(before) && enter_ball(a, ra, &z) && z < best && (height(z) < 0.0f || !(g > 0.0f))) {
        best = z;
        hit->u = 0.0f;
    }
    return best < INFINITE_DISTANCE && accept_curve_hit(ray, r.t, best, t_min, t_max, hit);
}

// ---- any --------------------------------------------------------------------------------------------------------

// s: the segment that the piece is of.
template <class F>
LUCH_FN bool intersect_piece_of(const CurveSegment& s, const CurveSet& set, u32 piece, const CurveRay<F>& ray,
                                float t_min, float t_max, TriangleHit* hit) {
    CurveShape look = look_of(set.shape);
    if (look == CurveShape::THICK_LINEAR) return intersect_linear(s, ray, t_min, t_max, hit);
    PieceRange range = range_of_piece(set.log2_pieces, piece);
    return look == CurveShape::RIBBON ? intersect_ribbon(s, range, ray, t_min, t_max, hit)
                                      : intersect_thick(s, range, ray, t_min, t_max, hit);
}
template <class F>
LUCH_FN bool intersect_piece(const CurveSet& set, u32 piece, const CurveRay<F>& ray, float t_min, float t_max,
                             TriangleHit* hit) {
    return intersect_piece_of(segment_of_piece(set, piece), set, piece, ray, t_min, t_max, hit);
}

// Whether the ray's line comes near a capsule at all; never false where intersect_piece hits.
LUCH_FN bool line_may_touch(const Capsule& c, Vec3 origin, Vec3 direction) {
    Vec3 f = c.a - origin, e = c.b - c.a;
    float inverse = 1.0f / dot(direction, direction);
    Vec3 p = f - direction * (dot(f, direction) * inverse), q = e - direction * (dot(e, direction) * inverse);
    float w = clamp_f(safe_divide(-dot(p, q), dot(q, q)), 0.0f, 1.0f);
    Vec3 nearest = p + q * w;
    float size = abs_f(f.x) + abs_f(f.y) + abs_f(f.z) + abs_f(e.x) + abs_f(e.y) + abs_f(e.z);
    float limit = c.radius + LINE_SLACK * size;
    return !(dot(nearest, nearest) > limit * limit + DENORMAL_SLACK);  // NaN: the test decides
}

}  // namespace luch

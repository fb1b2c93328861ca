// Radial Tiling: the plane cut into the segments of a polygon, each with coordinates of its own.
//
// operation      inputs                           outputs                              params
// RADIAL_TILING  0..1 x, y, 2 sides, 3 roundness  0..1 segment coordinates (across,    0 normalize (0/1)
//                                                 outwards), 2 segment number,
//                                                 3 width, 4 rotation (radians)
// A polygon of a fractional number of sides has sharp corners whatever its roundness.
#pragma once
#include "luch/math/fn.h"
#include "luch/shade/op.h"

namespace luch {

struct OpRadialTiling {
    static constexpr int inputs = 4, outputs = 5, params = 1;

    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        const float x = finite_f(in[0]) ? in[0] : 0.0f, y = finite_f(in[1]) ? in[1] : 0.0f;
        const float sides = clamp_f(in[2], 2.0f, 1e6f), roundness = saturate_f(in[3]);
        const bool normalize = params[0] != 0;
        const float angle = atan2_f(y, x);
        Place p;
        p.radius = sqrt_f(x * x + y * y);
        p.angle = angle + (y < 0.0f ? TWO_PI : 0.0f);
        p.half = PI / sides;
        p.start = floor_f(p.angle / (2.0f * p.half)) * (2.0f * p.half);
        p.local = p.angle - p.start;
        Segment s = fract_f(sides) != 0.0f ? fractional(p, sides, normalize)
                    : roundness == 0.0f    ? sharp(p, sides != 2.0f, normalize)
                    : roundness == 1.0f    ? circular(p, normalize)
                                           : rounded(p, roundness, normalize);
        if (x == 0.0f && y == 0.0f) s.across = 0.0f;
        out[0] = finite_or_zero(normalize ? 0.5f * s.across + 0.5f : s.across);
        out[1] = finite_or_zero(normalize ? s.outwards : s.outwards - 1.0f);
        out[2] = floor_f(sides * (angle * (0.5f * INV_PI) + (y < 0.0f ? 1.0f : 0.0f)));
        out[3] = finite_or_zero(s.width);
        out[4] = p.start + s.middle;
    }

 private:
    // A point by radius and angle; its segment by where it starts and by its half angle.
    struct Place {
        float radius, angle, half, start, local;
    };
    struct Segment {
        float across, outwards;  // coordinates: 0 on the bisector, 1 on the polygon
        float width;             // of half the segment at 1
        float middle;            // angle of the bisector from the segment's start
    };

    LUCH_FN static float finite_or_zero(float x) { return finite_f(x) ? x : 0.0f; }

    LUCH_FN static Segment sharp(const Place& p, bool has_width, bool normalize) {
        const float outwards = p.radius * cos_f(p.local - p.half), across = p.radius * sin_f(p.local - p.half);
        const float width = has_width ? tan_f(p.half) : 0.0f;
        return {normalize && has_width ? across / (outwards * width) : across, outwards, width, p.half};
    }

    LUCH_FN static Segment circular(const Place& p, bool normalize) {
        const float across = p.local - p.half;
        return {normalize ? across / p.half : across, p.radius, p.half, p.half};
    }

    // The last segment is narrower than the others.
    LUCH_FN static Segment fractional(const Place& p, float sides, bool normalize) {
        const float last_half = PI - floor_f(sides) * p.half;
        if (p.angle < TWO_PI - 2.0f * last_half) return sharp(p, true, normalize);
        const float scale = cos_f(p.half) / cos_f(last_half), width = tan_f(last_half);
        const float outwards = scale * p.radius * cos_f(p.local - last_half);
        const float across = scale * p.radius * sin_f(p.local - last_half);
        return {normalize ? across / (outwards * width) : across, outwards, width, last_half};
    }

    // Sides are straight up to `bevel` from the corner, round from there on.
    LUCH_FN static Segment rounded(const Place& p, float roundness, bool normalize) {
        const float flat = atan_f((1.0f - roundness) * tan_f(p.half)), bevel = p.half - flat;
        const float blend = (1.0f - roundness) * bevel, arc = roundness * bevel;
        Segment s{0.0f, 0.0f, tan_f(flat) + blend + arc, p.half};
        if (p.local >= bevel && p.local < 2.0f * p.half - bevel) {
            s.outwards = p.radius * cos_f(p.local - p.half);
            s.across = p.radius * sin_f(p.local - p.half);
            if (normalize) s.across /= s.outwards * tan_f(flat) + blend * 0.5f * (s.outwards + 1.0f) + arc;
            return s;
        }
        const float from_corner = p.local > p.half ? 2.0f * p.half - p.local : p.local;
        const float centre = (1.0f - roundness) / cos_f(p.half);  // of the corner's circle
        const float along = cos_f(from_corner) * centre;
        s.outwards = p.radius / (along + sqrt_f(along * along + roundness * roundness - centre * centre));
        const float into = bevel - from_corner;  // past the start of the bevel
        const float side = p.radius * sin_f(flat), up = p.radius * cos_f(flat);
        const float turn =
            into < blend ? up * into + 0.5f * (1.0f - up) * into * into / blend : blend * 0.5f * (up - 1.0f) + into;
        s.across = side + turn;
        if (normalize) {
            const float by_side = s.outwards * tan_f(flat) + blend * 0.5f * (s.outwards + 1.0f) + arc;
            const float by_radius = side + blend * 0.5f * (up + 1.0f) + arc;
            s.across /= mix_f(by_side, by_radius, into / bevel);
        }
        s.across = p.local < p.half ? -s.across : s.across;
        return s;
    }
};

}  // namespace luch

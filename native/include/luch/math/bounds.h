// Every error bound of the geometry code, with its derivation.
//
// Model: IEEE single precision, round to nearest, no contraction: fl(a op b) = (a op b)(1 + e), |e| <= EPS.
// gamma(n) = n EPS / (1 - n EPS) bounds n such factors in a row (Higham 2002, 3.1).
//
// 1. Box test (box.h); the idea of Woop, Benthin, Wald 2013, appendix, with margins that follow the geometry.
//    The triangle test decides on sheared vertices A' = fl(fl(v_x - o_x) - fl(s_x fl(v_z - o_z))), z the
//    dominant axis of the direction, |s_x| <= 1. Relative to the exact v_x - o_x - (d_x/d_z)(v_z - o_z) its
//    error is at most 2 EPS |v_x - o_x| + 5 EPS |v_z - o_z| (one rounding of each difference, one of s_x, one
//    of the product, one of the sum). The test is exact for the rounded A' (triangle.h): for an accepted ray
//    there are weights w with sum w A' = 0 in x and y, and t is the weighted depth. So the ray at t passes the
//    triangle's point P = sum w v at a distance along x (likewise y; none along z) of at most
//    sum w (2 EPS |v_x - o_x| + 5 EPS |v_z - o_z|). If all v_z - o_z have one sign, sum w |v_z - o_z| is
//    |P_z - o_z| = t |d_z|; if not, each is at most the triangle's extent. Together: 7 EPS (t |d_z| + extent).
//    Half of it widens the triangle's box when it is built (extent), half makes the ray a cone of that slope
//    (t |d_z|): entry (plane - o) / (|d_x| + slope), exit (plane - o) / (|d_x| - slope). A cone that reaches
//    both ways along an axis, |d_x| < 4 slope, strays from o_x by at most 5 slope t <= 5 slope / |d_z| times the
//    root box's extent: there the slab test is whether the widened slab holds o_x at all.
//    fl(fl(plane - o) * rdir) has three or four roundings and t one: rdir is moved by 8 EPS.
//    fl(plane - o) is monotone, so a parent's interval contains its child's.
//
// 2. Point on a triangle (surface.h). b0 p0 + b1 p1 + b2 p2 with b0 = 1 - b1 - b2: each product carries the
//    barycentric's own error (2 EPS, absolute on b0), a product and two sums: gamma(7) sum |b_i p_i| as in
//    pbrt-v4 6.8.4. The plane that a later ray meets is that of the sheared vertices of 1., seen from a point
//    on the triangle: 7 EPS times the triangle's extent.
//    Through an instance (world = M object + m, back M', m'): the point's transform adds gamma(3)(|M| |p| + |m|);
//    the later ray is taken to object space by the inverse with gamma(3)(|M'| |p_world| + |m'|), seen in the world
//    through |M|; or else the vertices themselves were taken to the world, gamma(3)(|M| |v| + |m|) again. M and M'
//    are rounded versions of each other's inverse: one more each, gamma(4). The sum of all covers both ways.
//
// 3. Point on a sphere (surface.h). c + r n: n is unit to gamma(4), a product, a sum: gamma(6) (|c| + r). A later ray is
//    tested in double against the same c and r, which adds nothing beside the instance's terms of 2.
#pragma once
#include "luch/math/vec.h"

namespace luch {

inline constexpr float EPS = 5.9604644775390625e-8f;  // 2^-24
inline constexpr float SHEAR_ERROR = 8.0f * EPS;
inline constexpr float SLAB_DOWN = 1.0f - 8.0f * EPS;
inline constexpr float SLAB_UP = 1.0f + 8.0f * EPS;

LUCH_FN constexpr float gamma_f(int n) { return float(n) * EPS / (1.0f - float(n) * EPS); }

// The next float above or below; infinities and NaN stay.
LUCH_FN float next_up(float x) {
    if (!finite_f(x)) return x;
    if (x == 0.0f) return bits_float(1u);
    u32 bits = float_bits(x);
    return bits_float(x > 0.0f ? bits + 1u : bits - 1u);
}
LUCH_FN float next_down(float x) { return -next_up(-x); }

// One float further, or two: without a branch, for numbers that are rounded outwards in bulk.
LUCH_FN float above(float x) { return x + 2.0f * EPS * abs_f(x); }
LUCH_FN float below(float x) { return x - 2.0f * EPS * abs_f(x); }

}  // namespace luch

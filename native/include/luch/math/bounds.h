// Every error bound of the geometry code, with its derivation.
//
// Model: IEEE single precision, round to nearest, no contraction: fl(a op b) = (a op b)(1 + e), |e| <= EPS.
// gamma(n) = n EPS / (1 - n EPS) bounds n such factors in a row (Higham 2002, 3.1).
//
// 1. Box test (box.h), after Woop, Benthin, Wald 2013, appendix.
//    The triangle test decides on sheared vertices A' = fl(fl(v_x - o_x) - fl(s_x fl(v_z - o_z))), z the
//    dominant axis of the direction, |s_x| <= 1. Relative to the exact v_x - o_x - (d_x/d_z)(v_z - o_z) its
//    error is at most 2 EPS |v_x - o_x| + 5 EPS |v_z - o_z| (one rounding of each difference, one of s_x, one
//    of the product, one of the sum). The test is exact for the rounded A' (triangle.h): an accepted ray
//    passes, at the t that the test returns, within that distance of the triangle along x, likewise y, and
//    exactly through its z range. So a box widened by SHEAR_ERROR (extent_x + extent_z) along x and y, not
//    along z, contains the ray at t; extents are taken over the root box, so they hold for every node.
//    The slab distance fl(fl(plane - origin') * rdir) has three roundings (difference, reciprocal, product),
//    t itself one more: rdir is moved by 8 EPS, more than the 5 EPS needed.
//    The difference plane - origin' rounds monotonically, so a parent's interval contains its child's.
//
// 2. Point on a triangle (surface.h). b0 p0 + b1 p1 + b2 p2 with b0 = 1 - b1 - b2: each product carries the
//    barycentric's own error (2 EPS, absolute on b0), a product and two sums: gamma(7) sum |b_i p_i| as in
//    pbrt-v4 6.8.4. The plane that a later ray meets is that of the sheared vertices of 1., seen from a point
//    on the triangle: 7 EPS times the triangle's extent.
//    Through an instance (world = M object + m, back M', m'): the point's transform adds gamma(3)(|M| |p| + |m|);
//    the later ray is taken to object space by the inverse with gamma(3)(|M'| |p_world| + |m'|), seen in the world
//    through |M|; or else the vertices themselves were taken to the world, gamma(3)(|M| |v| + |m|) again. M and M'
//    are rounded versions of each other's inverse: one more each, gamma(4). The sum of all covers both ways.
#pragma once
#include "luch/math/vec.h"

namespace luch {

inline constexpr float EPS = 5.9604644775390625e-8f;  // 2^-24
inline constexpr float SHEAR_ERROR = 6.0f * EPS;
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

}  // namespace luch

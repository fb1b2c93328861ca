// Every constant that decides accuracy, with its reason: bounds of rounding, and thresholds from which on a number
// counts as another. docs/numerics.md tells the derivations at length, with their sources, and which test holds each.
// tests/test_architecture.py keeps other headers free of such constants.
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
// 2. Point on a triangle (surface.h). p0 + (u (p1 - p0) + v (p2 - p0)): u and v are rounded once (triangle.h), so
//    that each term has three roundings, and their sum a fourth: gamma(4) (|u (p1 - p0)| + |v (p2 - p0)|), of the
//    triangle's size however far away it is. The last sum rounds: gamma(1) |p|. (b0 p0 + b1 p1 + b2 p2 of pbrt-v4
//    6.8.4 costs gamma(7) |p|.) The plane that a later ray meets is that of the sheared vertices of 1., seen from a
//    point on the triangle: 7 EPS times the triangle's extent. An instance that was taken to the world is traced with
//    just these corners: that is all. Else, through an instance (world = M object + m, back M', m'): the point's
//    transform adds gamma(3)(|M| |p| + |m|); the later ray is taken to object space by the inverse with
//    gamma(3)(|M'| |p_world| + |m'|), seen in the world through |M|. M and M' are rounded versions of each other's
//    inverse: one more each, gamma(4). (Twice the first: spheres, and walks under surfaces whose object is also traced
//    in the world.)
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

// How far a ray seen through an instance may differ from the ray in the world, at a point of size p: the origin and
// direction round in the transform, and to_object is only nearly the inverse of to_world. With C = |to_world|
// |to_object| (largest row sum of the linear parts) each is at most gamma(3) C |p|; three of them, doubled for second
// order terms.
inline constexpr float INSTANCE_ERROR = 18.0f * EPS;
// Instances with a larger C get wider boxes of their own instead of widening every ray.
inline constexpr float INSTANCE_CONDITION_WIDENED = 1000.0f;
// Beyond this C a matrix has no inverse to speak of (its squares leave the range from 1e19 on, its digits long before):
// it gets a thickness along the direction that it loses, this share of its size.
inline constexpr float INSTANCE_CONDITION_FLAT = 1e12f, FLAT_THICKNESS = 1e-5f;

// Coordinates beyond overflow in the boxes and products of the tests: such triangles are left out.
inline constexpr float LARGEST_COORDINATE = 1e37f;

// Planes of compressed wide trees are moved out by this many steps of their grid, entries of uniform grids stand in the
// cells that they touch when cells are widened by this share of their width (wide_ray.h, grid.h have the sums); the
// walk from cell to cell is taken where its own rounding, below GRID_DOUBT EPS of the distance, is within that.
inline constexpr float PLANE_MARGIN = 1.0f / 128.0f, GRID_MARGIN = 1.0f / 128.0f, GRID_DOUBT = 32.0f;

// Of a round curve's radius: how near its test comes to the surface, and how far along the axis its hit may lie off the
// circle that it is on (geometry/curve_test.h).
inline constexpr float THICK_TOLERANCE = 1e-4f, PLANE_TOLERANCE = 1e-3f;

// -- rays between surfaces -------------------------------------------------------------------------

// The shadow ray stops this fraction short of a sampled point, so that the light does not block itself: 84 ulp of the
// distance, where the point on the light and the ray to it are each off by a few.
inline constexpr float LIGHT_SHORTENING = 1e-5f;
// Points of a volume stay this far from both ends of a flight, so that rounding leaves none on the other side of a
// border: a part of its length, and of the size of its coordinates (16 ulp).
inline constexpr float FLIGHT_MARGIN = 1e-6f;
// Channels with smaller mean free paths are diffuse, metres (as in Cycles).
inline constexpr float SUBSURFACE_MIN_RADIUS = 1e-8f;

// -- closures --------------------------------------------------------------------------------------

// alpha_x alpha_y below which a lobe is a perfect mirror: the density at its peak, 1 / (pi alpha^2), and its square keep
// within the range, and the lobe is narrower than 1e-4 rad, a tenth of a pixel.
inline constexpr float MIRROR_ALPHA2 = 2e-10f;
// |ior - 1| below which refraction is straight through: it bends by less than that angle (rad), and reflects 2.5e-9.
inline constexpr float STRAIGHT_IOR = 1e-4f;
// Sharper lobes of Ashikhmin and Shirley are mirrors: their exponent would be above 2e8.
inline constexpr float PHONG_MIN_ALPHA = 1e-4f;
// Below this roughness Oren-Nayar is Lambert: they differ by less than a float tells.
inline constexpr float OREN_NAYAR_MIN_ROUGHNESS = 1e-5f;
// Lobes weaker than this are not worth a sample: all sixty-four of a list together are below 1e-3 of the light.
inline constexpr float LOBE_WEIGHT_CUTOFF = 1e-5f;

// -- lights ----------------------------------------------------------------------------------------

// Lamps below this extent (m) are points, and area lamps never get smaller: their radiance would leave the range. Their
// flux stays what it is.
inline constexpr float SMALLEST_RADIUS = 1e-8f, SMALLEST_EXTENT = 1e-6f;
// Brighter lamps count as broken: squares of their light leave the range.
inline constexpr float LARGEST_RADIANCE = 1e30f;
// Up to this ratio of extent to distance an area sample's weight h/d^3 varies by a few percent only.
inline constexpr float NARROW_RATIO_SQUARED = 0.01f;
// Below this solid angle (sr) a wide polygon is seen so flat that its angle has few digits left.
inline constexpr float FLAT_SOLID_ANGLE = 1e-4f;
// Above this a triangle fills nearly the hemisphere and the cut of it hangs on the last digits of its corners: take the
// hemisphere itself and lose the few samples that miss.
inline constexpr float HEMISPHERE_SOLID_ANGLE = 6.0f;

// -- motion ----------------------------------------------------------------------------------------

// From this cosine on, an arc is as good as its chord: they differ by 5e-7 rad.
inline constexpr float SHORT_ARC_COSINE = 0.9995f;

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

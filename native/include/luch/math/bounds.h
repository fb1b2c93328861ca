// Every constant that decides accuracy, with its reason: bounds of rounding, thresholds from which on a number counts
// as another, and the ends of ranges that inputs are kept in. docs/numerics.md tells the derivations at length, with
// their sources. tests/test_bounds.py keeps all other code free of such numbers; those below 1e-20, which keep a
// float from 0 or from the end of its range and are of no size that a picture has, stand where they are used.
// Doubles are of the CPU alone, where scenes are built.
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

// Numbers whose last place is the least denormal do not grow by a share of themselves: what boxes get beside, and what
// the square of a distance may be off by.
inline constexpr float DENORMAL_MARGIN = 1e-44f, DENORMAL_SLACK = 1e-43f;
// Rays whose direction's largest component is outside hit nothing: squares of it leave the range long before, but the
// triangle test takes none, and its quotients keep within the range.
inline constexpr float SMALLEST_DIRECTION = 1e-37f, LARGEST_DIRECTION = 1e37f;
// Rays pass by a box that is wider by this share of the way to its far side, twice what pass_by.h needs, and by the
// second, below which products lose digits.
inline constexpr float PASS_ERROR = 4.0f * SHEAR_ERROR, PASS_SLACK = 1e-37f;

// Coordinates beyond overflow in the boxes and products of the tests: such triangles are left out.
inline constexpr float LARGEST_COORDINATE = 1e37f;

// Planes of compressed wide trees are moved out by this many steps of their grid, entries of uniform grids stand in the
// cells that they touch when cells are widened by this share of their width (wide_ray.h, grid.h have the sums); the
// walk from cell to cell is taken where its own rounding, below GRID_DOUBT EPS of the distance, is within that.
inline constexpr float PLANE_MARGIN = 1.0f / 128.0f, GRID_MARGIN = 1.0f / 128.0f, GRID_DOUBT = 32.0f;

// The compressed trees' reciprocals are moved by SLAB_UP's eight and eight of their own: slope, reciprocal, x, 1 - x,
// two products, that with the step, the fused sum. A hit's distance has a product and a sum, and each its constant.
inline constexpr float WIDE_SLAB_ERROR = 16.0f * EPS, WIDE_HIT_ERROR = 4.0f * EPS;
// In cells, in double: far above what rounding leaves there, far below the margin. The second is that of products of
// two edges, times their squared length in cells.
inline constexpr double GRID_CELL_ERROR = 1e-9, GRID_FLAT_ERROR = 1e-13;
// A point on a triangle's edge where a plane cuts it, in single precision: a weight of three roundings, a product, a
// sum, and the twice that boxes are moved by beside.
inline constexpr float CUT_ERROR = SHEAR_ERROR + 6.0f * EPS;

// How far the point of the ray's line that is nearest to a sphere's centre, or to a capsule's axis, may be off,
// relative to the distance f between that and the ray's origin: f is rounded, 1 EPS; a, b and the direction give s =
// b / a with gamma(10) |f| / |d|, its product and the sum 3 EPS |f| more; over three axes gamma(25). The test in single
// precision may be off as much again. |f| is at most the sum over the axes.
inline constexpr float LINE_SLACK = 64.0f * EPS;
// A curve's points are found relative to its segment by the weights of a cubic, of five roundings: with a product and
// three sums gamma(9) a coordinate, 27 for three, once where the test asks and once for the box, together below 64 of
// the segment's size; its corners come from the mesh's space by differences and a matrix: below 16 of the place.
inline constexpr float CURVE_SIZE_ERROR = 64.0f * EPS, CURVE_PLACE_ERROR = 16.0f * EPS;
// Squared sine of the angle between ray and curve below which the ray would enter by the open end: 1e-5 rad, where the
// place along the curve has lost five digits of seven.
inline constexpr float CURVE_ALONG_SINE2 = 1e-10f;
// A ribbon's tangent that is as near to the ray tells no side: its last digits alone would.
inline constexpr float RIBBON_ALONG_SINE = 4.0f * EPS;
// A ribbon turns to each ray anew, so one that leaves it would meet it again. It is not met nearer than this many radii
// from a ray's start (Cycles has the same rule), nor at all by a ray that starts within it, were it round: so far from
// its axis, in radii.
inline constexpr float RIBBON_START_RADII = 2.0f, RIBBON_WITHIN_RADII = 1.05f;

// Of a round curve's radius: how near its test comes to the surface, and how far along the axis its hit may lie off the
// circle that it is on (geometry/curve_test.h).
inline constexpr float THICK_TOLERANCE = 1e-4f, PLANE_TOLERANCE = 1e-3f;

// -- rays between surfaces -------------------------------------------------------------------------

// The shadow ray stops this fraction short of a sampled point, so that the light does not block itself: 84 ulp of the
// distance, where the point on the light and the ray to it are each off by a few.
inline constexpr float LIGHT_SHORTENING = 1e-5f;
// Boxes of lamps grow by a share of themselves, by a share of their place and by as many metres, and their slabs by a
// few ulp: 168 ulp of the size and 16 of the place, of which a slab's distance loses five. Lamps have no exact hits.
inline constexpr float LAMP_BOX_GROWTH = 1.00001f, LAMP_BOX_PLACE = 1e-6f, LAMP_BOX_LEAST = 1e-7f;
inline constexpr float LAMP_SLAB_UP = 1.0000004f;
// Points of a volume stay this far from both ends of a flight, so that rounding leaves none on the other side of a
// border: a part of its length, and of the size of its coordinates (16 ulp).
inline constexpr float FLIGHT_MARGIN = 1e-6f;
// The largest float below 1: what a random number becomes whose rest after a choice is rounded up.
inline constexpr float BELOW_ONE = 0.99999994f;

// -- photons ---------------------------------------------------------------------------------------

// The triangle that a photon starts at is met where it was sampled, but for rounding, relative to the way there: 67 EPS.
inline constexpr float CASTER_DISTANCE_ERROR = 4e-6f;
// From lamps that cast no shadow photons come from no further, relative to the triangle's size: nothing lies between.
inline constexpr float SHADOWLESS_DISTANCE = 1e-3f;
// Photons further from the tangent plane than this part of the radius, or of a surface that is turned away by more than
// this cosine, lie on another surface.
inline constexpr float FLAT_PART = 0.3f, SAME_SIDE_COSINE = 0.7f;
// Where photons graze a smooth-shaded mesh, what they bring of it is bounded: by face and by smooth normals flux is
// told apart by the quotient of two cosines, which lies near 1 elsewhere.
inline constexpr float LEAST_PHOTON_COSINE = 0.05f, MOST_NORMAL_CORRECTION = 8.0f;
// Of the scene's size: the finest radius of photon maps where a pilot's photons are too few to tell one.
inline constexpr float UNTOLD_RADIUS = 5e-4f;

// -- cameras ---------------------------------------------------------------------------------------

// The near plane moves in, the far one out, by more than a hit's distance rounds, and the near one by more than the
// camera's place does: what lies exactly in a clipping plane is wholly visible.
inline constexpr double CLIP_SLACK = 4e-6, CLIP_PLACE_SLACK = 5e-7;
// Axes are unit: the volume that they span. Below, two are one to 1e-12 rad.
inline constexpr double FLAT_CAMERA = 1e-12;
// Ends of what cameras have: focal lengths of pinholes and of fisheyes, mm; the size of a picture's plane, rad or m;
// the f-number, the aperture's ratio and the distance of the focus, m.
inline constexpr double SMALLEST_LENS = 1e-9, SMALLEST_FISHEYE = 1e-6, SMALLEST_PLANE = 1e-9, SMALLEST_STOP = 1e-5;

// -- subsurface ------------------------------------------------------------------------------------

// Channels with smaller mean free paths are diffuse, metres (as in Cycles); the least that is divided by, when the
// other channels are not.
inline constexpr float SUBSURFACE_MIN_RADIUS = 1e-8f, SMALLEST_FREE_PATH = 1e-16f;
// A mean free path must also be this many units in the last place of the point's position (as seen from the camera):
// walks begin inside the surface by its error bound, about 20 of them, and would lose themselves in rounding. Shorter
// ones are a sixtieth of a pixel and less in a picture of 1,000.
inline constexpr float SUBSURFACE_MIN_ULP = 256.0f;
// Interfaces that walks begin at, and the anisotropy where a phase function is no delta yet, or its fit still holds.
inline constexpr float SUBSURFACE_MIN_IOR = 1.01f, SUBSURFACE_MAX_IOR = 3.8f;
inline constexpr float SUBSURFACE_MAX_ANISOTROPY = 0.99f, SUBSURFACE_MAX_ANISOTROPY_FIT = 0.9f;
// Below this single-scattering albedo light hardly comes back and guiding has nothing to go by: the walk is that of
// this albedo, darkened in proportion (as Cycles does; the colour is below 0.03 there).
inline constexpr float MEDIUM_MIN_ALBEDO = 0.2f;
// Profiles end at so many of their lengths; what lies within: 1 - e^-16 / 4 - 3/4 e^(-16/3).
inline constexpr float PROFILE_REACH = 16.0f, PROFILE_SHARE = 0.9963790093708328f;
// Walks never end in a medium that absorbs nothing; what 256 steps of this lose is 2.6e-4.
inline constexpr float MEDIUM_MAX_ALBEDO = 0.999999f;
// Walks weaker than this are dropped (as in Cycles).
inline constexpr float WALK_CUTOFF = 1e-6f;
// Colours for which the skin's dipole is not inverted: it would stop between two halvings.
inline constexpr float SKIN_DARKEST = 1e-4f, SKIN_BRIGHTEST = 0.995f;
// Squared cosine of a refracted ray: a rough interface seen from under a lighter one has none at all.
inline constexpr float ENTRY_COSINE2 = 1e-14f;
// 1 - power of the albedo in the diffusion length: a medium that absorbs nothing has none that is finite.
inline constexpr float LEAST_DIFFUSION = 1e-7f;

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
// Cosines that are divided by: a surface seen under 1e-6 rad has 1e-12 of the light of the hemisphere there.
inline constexpr float SMALLEST_COSINE = 1e-6f;
// Indices of refraction: their squares and quotients fit a float with room for products.
inline constexpr float SMALLEST_IOR = 1e-5f, LARGEST_IOR = 1e6f;
// The Layer Weight node's Facing has no exponent at 1 (as in Blender).
inline constexpr float LAYER_FACING_MARGIN = 1e-5f;
// Reflectances from which an index is taken back: the index is (1 + r) / (1 - r), and at 1 there is none. A film scales
// what lies under it by F0, which it cannot where there is none.
inline constexpr float FILM_MIN_THICKNESS_NM = 0.1f;  // an atom's: thinner films are no films
inline constexpr float MOST_F0 = 0.99f, FILM_MOST_F0 = 0.999f, FILM_LEAST_F0 = 1e-5f;
// Anisotropy below which a lobe is round; and the most of it: one width is then ten thousand times the other.
inline constexpr float LEAST_ANISOTROPY = 1e-4f, MOST_ANISOTROPY = 0.99f;
// Squared sine of the angle between tangent and normal below which the tangent has no direction in the surface.
inline constexpr float TANGENT_SINE2 = 1e-12f;
// The cosine at which a bumped mirror sends light off the surface at least (as in Cycles): 0.6 degrees.
inline constexpr float LEAST_MIRROR_HEIGHT = 0.01f;
// Sheen. Squared sine below which the viewer looks straight down, where every tangent serves; the smoothest of the
// table; transforms and albedos below reflect nothing.
inline constexpr float SHEEN_HEAD_ON_SINE2 = 1e-14f, SHEEN_MIN_ROUGHNESS = 1e-3f, SHEEN_LEAST = 1e-5f;
// Its older distribution: the smoothest (as in Blender), and how near to the poles of both cosines it is 0.
inline constexpr float VELVET_MIN_ROUGHNESS = 0.01f, VELVET_LEAST = 1e-5f;
// A toon lobe's smallest size: 1.6e-5 rad, where a density is 1e9 and its square in range.
inline constexpr float TOON_LEAST_SIZE = 1e-5f;
// Beckmann: where erf's inverse ends (one ulp more of its number is 0.06 there), how near the slope's
// distribution is met, the sine below which all slopes are as visible, and (alpha tan)^2 below which nothing is hidden.
inline constexpr float ERF_INVERSE_END = 0.9999999f, BECKMANN_TOLERANCE = 1e-6f, BECKMANN_HEAD_ON_SINE = 1e-4f;
inline constexpr float BECKMANN_NO_SHADOW = 1e-2f;
// Hair. Radians from the fibre's own direction where nothing is reflected; the smoothest; its indices; what is left of
// white at melanin 1; the root of n^2 - sin^2 that is divided by; the random number whose logarithm is taken.
inline constexpr float GRAZING_FIBRE = 0.001f, FIBRE_MIN_ROUGHNESS = 0.001f;
inline constexpr float FIBRE_SMALLEST_IOR = 1e-3f, FIBRE_LARGEST_IOR = 1e3f, LIGHTEST_HAIR = 0.0001f;
inline constexpr float SMALLEST_FIBRE_ROOT = 1e-12f, LEAST_FIBRE_NUMBER = 1e-5f;
// Paths that carry less than this to the passes that guide a denoiser stop writing there.
inline constexpr float FEATURE_CUTOFF = 1e-4f;
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
// A sun's half angle, a sky's sun and an area lamp's half spread (rad) below which light comes from one direction.
inline constexpr float SMALLEST_HALF_SUN = 1e-6f, SMALLEST_WORLD_SUN = 1e-6f;
inline constexpr double SMALLEST_SPREAD = 1e-5;
// A spot's cosines and tangents that are divided by.
inline constexpr float SMALLEST_SPOT = 1e-12f;
// Half angles (rad) beyond are a half space, whose tangent has no digit; below, tan a - a is taken from its series.
inline constexpr double FLATTEST_CONE = 1.5707, SPREAD_SERIES = 0.02;
// The rectangle's arc: the sine that is divided by, and 1 - h^2 below which its own end is taken.
inline constexpr float RECTANGLE_LEAST_SINE = 1e-7f, RECTANGLE_LEAST_REST = 1e-6f;
// The tree of lights only guides samples, and may be off; it must never say 0 where light arrives. Slack of the tests
// that say so: of the height above a surface, of the cosine and the angle (rad) that an emitter's normals reach.
inline constexpr float LIGHT_FACING_SLACK = 1e-5f, LIGHT_REACH_SLACK = 1e-4f, LIGHT_CONE_MARGIN = 1e-3f;
// And the least that it takes a cosine, the variance of one, the width of a beam (rad) and a squared diagonal (m^2) for.
inline constexpr float LIGHT_LEAST_COSINE = 0.02f, LIGHT_LEAST_VARIANCE = 1e-4f, NARROWEST_BEAM = 0.02f;
inline constexpr float LEAST_DIAGONAL2 = 1e-12f;
// The most that samples of a sky go to its sun; a map that rises less than this above its mean is even, and counts
// for as much beside lamps: rays find it.
inline constexpr float WORLD_SUN_MOST = 0.95f;
inline constexpr double EVEN_WORLD_SHARE = 0.02;
// Below this solid angle (sr) a wide polygon is seen so flat that its angle has few digits left.
inline constexpr float FLAT_SOLID_ANGLE = 1e-4f;
// Above this a triangle fills nearly the hemisphere and the cut of it hangs on the last digits of its corners: take the
// hemisphere itself and lose the few samples that miss.
inline constexpr float HEMISPHERE_SOLID_ANGLE = 6.0f;

// -- volumes and skies -----------------------------------------------------------------------------

// Coefficients (1/m) below are none: a thousand kilometres of it change light by 0.1 %. Above, mean free paths are
// shorter than any picture shows.
inline constexpr float THINNEST_MEDIUM = 1e-9f, DENSEST_MEDIUM = 1e9f;
// Beyond it a phase function is a straight line to single precision; below, it is even: g / 3 of the light at most.
inline constexpr float SHARPEST_PHASE = 0.999f, ISOTROPIC_BELOW = 1e-3f;
// Optical depths below which exponentials are taken from their series: of four terms, and of two.
inline constexpr float SERIES_BELOW = 1e-2f, THIN_FLIGHT = 1e-3f;
// Equiangular samples: so many heights from the foot at most, and the angle of that; the least height, of the distance
// of the foot, and that distance (m).
inline constexpr float EQUIANGULAR_REACH = 1e4f, EQUIANGULAR_STEEPEST = 1.57069633f;
inline constexpr float EQUIANGULAR_LEAST_HEIGHT = 1e-4f, EQUIANGULAR_LEAST_FOOT = 1e-6f;
// The first knot of a phase function's table, in sin^2(angle / 2): an angle of 2e-7, past the peak of g = 0.999 and
// most of that of Fournier and Forand, which has no end. Knots are 3.2 % apart, so lines between them are within 5e-4.
inline constexpr double PHASE_FIRST_KNOT = 1e-14;
// Fournier and Forand: the least share scattered back, and the most less a half; how far from its removable pole both
// sides stand in for it, which are alike to 1e-6.
inline constexpr double LEAST_BACKSCATTER = 1e-4, FOURNIER_GAP = 1e-3;
// The sky's air: the least height (km) whose logarithm is taken, the least extinction (1/km) that is divided by, and
// the angle (rad) above the horizon from which on Preetham's sky is that of the horizon.
inline constexpr float SKY_LOWEST_KM = 1e-4f, SKY_THINNEST = 1e-7f, SKY_HORIZON = 0.001f;

// -- nodes -----------------------------------------------------------------------------------------

// What Blender's own nodes have, so that pictures agree: the tolerance of Compare at least (one ulp of 1), the shift
// that takes coordinates off cell borders, the weight from which on a hybrid fractal's octaves count, Gabor's lowest
// frequency, the squared distance of Voronoi points that are one, and the angle (rad) of an IES profile's pole.
inline constexpr float COMPARE_LEAST = 2.0f * EPS, OFF_BORDER = 1e-6f, FRACTAL_CUTOFF = 0.001f;
inline constexpr float GABOR_LEAST_FREQUENCY = 0.001f, VORONOI_SAME_POINT = 1e-4f, IES_POLE = 1e-7f;

// -- builders --------------------------------------------------------------------------------------

// Bins of a cut are this share of their width wide, so that the last one holds the far end after rounding.
inline constexpr float BIN_SHARE = 0.9999f;
// Scales along a matrix' axes, or the angles between them, that differ by less than this share look the same.
inline constexpr float EVEN_SCALE = 1e-4f;

// -- where the camera's place is 0 -----------------------------------------------------------------

// A camera that moves over a prepared scene keeps its origin while that moves what it sees by at most this part of a
// pixel. With the old origin at distance d from the camera, coordinates near it are of size d instead of 0: a matrix's
// place rounds once, a corner's three sums once each, the ray's origin (camera, then near plane) three times, and
// through an instance of its own space as the last two again, gamma(3) (|M'| |p| + |m'|): at most 10 EPS d together.
inline constexpr float ORIGIN_SHIFT_PIXELS = 1.0f / 64.0f;
inline constexpr float ORIGIN_ROUNDINGS = 10.0f;

// -- motion ----------------------------------------------------------------------------------------

// From this cosine on, an arc is as good as its chord: they differ by 5e-7 rad.
inline constexpr float SHORT_ARC_COSINE = 0.9995f;
// Of a longer arc: half a turn has a sine of 0 and no direction, and is taken as its chord.
inline constexpr float SMALLEST_ARC_SINE = 1e-6f;
// Where the iteration for a matrix' rotation ends: it converges quadratically, so the next step would be 1e-24.
inline constexpr double POLAR_ENOUGH = 1e-12;

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

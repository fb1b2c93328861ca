#include "cpu/accel/kd_clip.h"

namespace luch::cpu {
namespace {

constexpr int MOST_CORNERS = 24;  // three, and up to two more for each of six planes

struct Polygon {
    double corner[MOST_CORNERS][3];
    int count;
};

// Calls keep(point) for the corners of the part with side * (x - plane) >= 0 along axis, side 1 or -1, in order.
template <class Keep>
void cut(const Polygon& from, int axis, double plane, double side, Keep&& keep) {
    for (int i = 0; i < from.count; ++i) {
        const double *a = from.corner[i], *b = from.corner[i + 1 < from.count ? i + 1 : 0];
        double height_a = side * (a[axis] - plane), height_b = side * (b[axis] - plane);
        if (height_a >= 0) keep(a);
        if ((height_a < 0) == (height_b < 0)) continue;
        double part = height_a / (height_a - height_b);
        double p[3];
        for (int k = 0; k < 3; ++k) p[k] = a[k] + (b[k] - a[k]) * part;
        p[axis] = plane;
        keep(p);
    }
}

// A polygon so thin that rounding gives it more corners than a convex one can have stays whole.
Polygon cut(const Polygon& from, int axis, double plane, double side) {
    Polygon out;
    out.count = 0;
    int corners = 0;
    cut(from, axis, plane, side, [&](const double* p) {
        if (++corners > MOST_CORNERS) return;
        for (int k = 0; k < 3; ++k) out.corner[out.count][k] = p[k];
        ++out.count;
    });
    return corners > MOST_CORNERS ? from : out;
}

float round_down(double x) {
    float f = float(x);
    return double(f) > x ? next_down(f) : f;
}
float round_up(double x) {
    float f = float(x);
    return double(f) < x ? next_up(f) : f;
}

// The box of a part of the polygon, widened, within the box that it was cut from.
Box bound(const Polygon& polygon, int axis, double plane, double side, double margin, const Box& within) {
    double lo[3] = {1e300, 1e300, 1e300}, hi[3] = {-1e300, -1e300, -1e300};
    cut(polygon, axis, plane, side, [&](const double* p) {
        for (int k = 0; k < 3; ++k) {
            lo[k] = p[k] < lo[k] ? p[k] : lo[k];
            hi[k] = p[k] > hi[k] ? p[k] : hi[k];
        }
    });
    if (lo[0] > hi[0]) return empty_box();
    Vec3 low = {round_down(lo[0] - margin), round_down(lo[1] - margin), round_down(lo[2] - margin)};
    Vec3 high = {round_up(hi[0] + margin), round_up(hi[1] + margin), round_up(hi[2] + margin)};
    return {max_v(low, within.lo), min_v(high, within.hi)};
}

}  // namespace

Halves cut_box(const Box& box, int axis, float plane) {
    Halves out = {box, box};
    (axis == 0 ? out.below.hi.x : axis == 1 ? out.below.hi.y : out.below.hi.z) = plane;
    (axis == 0 ? out.above.lo.x : axis == 1 ? out.above.lo.y : out.above.lo.z) = plane;
    return out;
}

Halves cut_primitive(const Primitives& all, u32 ref, const Box& box, int axis, float plane) {
    Halves halves = cut_box(box, axis, plane);
    if (ref >= all.triangle_count) return halves;
    const float* p = all.corners + 9 * u64(ref);
    Polygon polygon;
    polygon.count = 3;
    double extent = 0, lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
        double a = double(p[k]), b = double(p[3 + k]), c = double(p[6 + k]);
        polygon.corner[0][k] = a;
        polygon.corner[1][k] = b;
        polygon.corner[2][k] = c;
        lo[k] = a < b ? (a < c ? a : c) : (b < c ? b : c);
        hi[k] = a > b ? (a > c ? a : c) : (b > c ? b : c);
        extent = hi[k] - lo[k] > extent ? hi[k] - lo[k] : extent;
    }
    double margin = double(SHEAR_ERROR) * extent + 1e-44;  // as triangle_box: the least denormals do not scale
    for (int k = 0; k < 3; ++k) {
        double low = double(box.lo[k]) - margin, high = double(box.hi[k]) + margin;
        if (lo[k] < low) polygon = cut(polygon, k, low, 1);
        if (hi[k] > high) polygon = cut(polygon, k, high, -1);
    }
    halves.below = bound(polygon, axis, double(plane) + margin, -1, margin, halves.below);
    halves.above = bound(polygon, axis, double(plane) - margin, 1, margin, halves.above);
    return halves;
}

}  // namespace luch::cpu

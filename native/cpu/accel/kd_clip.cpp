#include "cpu/accel/kd_clip.h"

#include "cpu/accel/simd.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

constexpr int MOST_CORNERS = 24;  // three, and up to two more for each of six planes

struct Polygon {
    d4 corner[MOST_CORNERS];  // x, y, z, 0
    int count;
};

// Calls keep(point) for the corners of the part with side * (x - plane) >= 0 along axis, side 1 or -1, in order.
template <class Keep>
void cut(const Polygon& from, int axis, double plane, double side, Keep&& keep) {
    using Lanes = i64 __attribute__((vector_size(32)));
    const Lanes on_axis = Lanes{0, 1, 2, 3} == i64(axis);
    const d4 at_plane = splat<d4>(plane);
    auto height_of = [&](int i) { return side * (from.corner[i][axis] - plane); };
    double first_height = height_of(0), height_a = first_height;
    for (int i = 0; i < from.count; ++i) {
        bool last = i + 1 == from.count;
        double height_b = last ? first_height : height_of(i + 1);
        d4 a = from.corner[i];
        if (height_a >= 0) keep(a);
        if ((height_a < 0) != (height_b < 0)) {
            d4 b = from.corner[last ? 0 : i + 1];
            double part = height_a / (height_a - height_b);
            d4 p = a + (b - a) * part;
            keep(on_axis ? at_plane : p);
        }
        height_a = height_b;
    }
}

// False, and out is of no use, if the polygon is so thin that rounding gives it more corners than a convex one can have.
bool cut(const Polygon& from, int axis, double plane, double side, Polygon* out) {
    int corners = 0;
    cut(from, axis, plane, side, [&](d4 p) {
        if (corners < MOST_CORNERS) out->corner[corners] = p;
        ++corners;
    });
    out->count = corners;
    return corners <= MOST_CORNERS;
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
    d4 lo = splat<d4>(1e300), hi = splat<d4>(-1e300);
    cut(polygon, axis, plane, side, [&](d4 p) {
        lo = min_of(p, lo);
        hi = max_of(p, hi);
    });
    if (lo[0] > hi[0]) return empty_box();
    lo -= margin;
    hi += margin;
    Vec3 low = {round_down(lo[0]), round_down(lo[1]), round_down(lo[2])};
    Vec3 high = {round_up(hi[0]), round_up(hi[1]), round_up(hi[2])};
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
    Polygon polygons[2];  // the current one, and room for its part
    Polygon* polygon = polygons;
    polygon->count = 3;
    for (int i = 0; i < 3; ++i)
        polygon->corner[i] = d4{double(p[3 * i]), double(p[3 * i + 1]), double(p[3 * i + 2]), 0.0};
    d4 lo = min_of(min_of(polygon->corner[0], polygon->corner[1]), polygon->corner[2]);
    d4 hi = max_of(max_of(polygon->corner[0], polygon->corner[1]), polygon->corner[2]);
    d4 size = hi - lo;
    double extent = size[0] > size[1] ? size[0] : size[1];
    extent = size[2] > extent ? size[2] : extent;
    double margin =
        double(SHEAR_ERROR) * extent + double(DENORMAL_MARGIN);  // as triangle_box: the least denormals do not scale
    auto cut_off = [&](int k, double at, double side) {
        Polygon* other = polygon == polygons ? polygons + 1 : polygons;
        if (cut(*polygon, k, at, side, other)) polygon = other;
    };
    for (int k = 0; k < 3; ++k) {
        double low = double(box.lo[k]) - margin, high = double(box.hi[k]) + margin;
        if (lo[k] < low) cut_off(k, low, 1);
        if (hi[k] > high) cut_off(k, high, -1);
    }
    halves.below = bound(*polygon, axis, double(plane) + margin, -1, margin, halves.below);
    halves.above = bound(*polygon, axis, double(plane) - margin, 1, margin, halves.above);
    return halves;
}

}  // namespace luch::cpu

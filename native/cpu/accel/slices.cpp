#include "cpu/accel/slices.h"

#include <algorithm>
#include <utility>

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

f8 point(const float* p) { return f8{-p[0], -p[1], -p[2], 0.0f, p[0], p[1], p[2], 0.0f}; }
void add_edge(f8 a, f8 b, int axis, const float* planes, int count, f8* out) {
    if (a[axis + 4] > b[axis + 4]) std::swap(a, b);
    float from = a[axis + 4], to = b[axis + 4];
    int part = 0;
    while (part < count && from >= planes[part]) ++part;
    out[part] = united(out[part], a);
    for (; part < count && to >= planes[part]; ++part) {
        f8 crossing = a + (b - a) * ((planes[part] - from) / (to - from));
        if (!(to > from)) crossing = b;
        out[part] = united(out[part], crossing);
        out[part + 1] = united(out[part + 1], crossing);
    }
    out[part] = united(out[part], b);
}

// Each part of the axis with the ball's room before and behind it, widened by the radius; returns the error.
float cut_capsule(const Capsule& c, int axis, const float* planes, int count, f8* out) {
    float from = c.a[axis], to = c.b[axis], inverse = safe_divide(1.0f, to - from);
    for (int i = 0; i <= count; ++i) {
        float lo = i > 0 ? planes[i - 1] - c.radius : -INFINITE_DISTANCE;
        float hi = i < count ? planes[i] + c.radius : INFINITE_DISTANCE;
        float s0 = 0.0f, s1 = 1.0f;
        if (inverse != 0.0f) {
            float first = (lo - from) * inverse, last = (hi - from) * inverse;
            s0 = max_f(min_f(first, last), 0.0f);
            s1 = min_f(max_f(first, last), 1.0f);
        }
        if (!(s0 <= s1)) continue;
        Vec3 p = c.a + (c.b - c.a) * s0, q = c.a + (c.b - c.a) * s1;
        f8 a = point(&p.x), b = point(&q.x);
        out[i] = united(united(a + c.radius, a - c.radius), united(b + c.radius, b - c.radius));
        if (i > 0) out[i][axis] = min_f(out[i][axis], -planes[i - 1]);
        if (i < count) out[i][axis + 4] = min_f(out[i][axis + 4], planes[i]);
    }
    return CUT_ERROR * (max_component(abs_v(c.b - c.a)) + c.radius);
}

int slices_for(u32 refs) { return refs <= 16 ? 4 : refs <= 64 ? 8 : MAX_SLICES; }

}  // namespace

void Clipper::cut(const PrimBox& ref, int axis, const float* planes, int count, f8* out) const {
    std::fill_n(out, count + 1, nothing());
    float error;
    if (ref.id < all_.triangle_count) {
        const float* p = all_.corners + 9 * u64(ref.id);
        f8 corners[3] = {point(p), point(p + 3), point(p + 6)};
        for (int k = 0; k < 3; ++k) add_edge(corners[k], corners[(k + 1) % 3], axis, planes, count, out);
        f8 whole = united(united(corners[0], corners[1]), corners[2]);
        error = CUT_ERROR * max_f(whole[0] + whole[4], max_f(whole[1] + whole[5], whole[2] + whole[6]));
    } else if (is_piece(all_, ref.id)) {
        error = cut_capsule(piece_capsule(all_.curves, piece_of(all_, ref.id)), axis, planes, count, out);
    } else {
        const float* s = all_.spheres + 4 * u64(ref.id - all_.triangle_count);
        const float radius = abs_f(s[3]);
        f8 whole = united(point(s) + radius, point(s) - radius);
        for (int i = 0; i <= count; ++i) {
            out[i] = whole;
            if (i > 0) out[i][axis] = min_f(whole[axis], -planes[i - 1]);
            if (i < count) out[i][axis + 4] = min_f(whole[axis + 4], planes[i]);
        }
        error = CUT_ERROR * radius;
    }
    f8 before = load_box(ref);
    for (int i = 0; i <= count; ++i) {
        f8 sign = out[i] < 0.0f ? splat<f8>(-2.0f * EPS) : splat<f8>(2.0f * EPS);
        f8 part = min_of(out[i] + out[i] * sign + (error + DENORMAL_MARGIN), before);
        out[i] = is_empty(part) ? nothing() : part;
    }
}

Slicing::Slicing(const PrimSet& set, const Clipper& clipper) : clipper_(clipper), slices_(slices_for(set.count())) {
    const Corners& box = set.box;
    for (int axis = 0; axis < 3; ++axis) {
        float extent = box.extent(axis);
        usable_[axis] = extent > 1e-30f && extent < 1e37f;
        inverse_step_[axis] = float(slices_) / extent;
        for (int s = 0; s < slices_; ++s) planes_[axis][s] = -box.v[axis] + extent / float(slices_) * float(s);
    }
}

int Slicing::slice_of(int axis, float x) const {
    const float* planes = planes_[axis];
    int slice = int(clamp_f((x - planes[0]) * inverse_step_[axis], 0.0f, float(slices_ - 1)));
    while (slice > 0 && x < planes[slice]) --slice;
    while (slice + 1 < slices_ && x >= planes[slice + 1]) ++slice;
    return slice;
}

void Slicing::add(const PrimBox& ref, Slices* out) const {
    for (int axis = 0; axis < 3; ++axis) {
        if (!usable_[axis]) continue;
        int first = slice_of(axis, -ref.minus_lo[axis]), last = slice_of(axis, ref.hi[axis]);
        ++out->begin[axis][first];
        ++out->end[axis][last];
        f8 parts[MAX_SLICES] = {load_box(ref)};
        if (first < last) clipper_.cut(ref, axis, planes_[axis] + first + 1, last - first, parts);
        for (int s = first; s <= last; ++s) out->box[axis][s] = united(out->box[axis][s], parts[s - first]);
    }
}

Cut choose_cut(const Slices& slices, const Slicing& slicing) {
    Cut best;
    for (int axis = 0; axis < 3; ++axis) {
        if (!slicing.usable(axis)) continue;
        f8 right[MAX_SLICES + 1];
        u32 right_count[MAX_SLICES + 1] = {};
        right[MAX_SLICES] = nothing();
        for (int b = MAX_SLICES - 1; b > 0; --b) {
            right[b] = united(right[b + 1], slices.box[axis][b]);
            right_count[b] = right_count[b + 1] + slices.end[axis][b];
        }
        f8 left = nothing();
        u32 left_count = 0;
        for (int b = 1; b < MAX_SLICES; ++b) {
            left = united(left, slices.box[axis][b - 1]);
            left_count += slices.begin[axis][b - 1];
            if (left_count == 0 || right_count[b] == 0) continue;
            float cost = half_area(left) * float(left_count) + half_area(right[b]) * float(right_count[b]);
            if (cost < best.cost) best = {cost, axis, b, left, right[b], left_count, right_count[b]};
        }
    }
    return best;
}

}  // namespace luch::cpu

// Cutting sets of primitives by planes: each set's box is sliced along each axis, and primitives are clipped to slices.
//
// Clipped boxes stay conservative (math/bounds.h, 1): a ray passes the accepted point P of a triangle at no more than
// half of 7 EPS (t |d_z| + extent) from each plane, and P, an exact mean of the corners, lies in the part on one side.
// So the exact part's box, widened like the whole triangle's by its whole extent, holds what the cone must find, and
// so does its intersection with the box before the cut. The cut's own rounding widens it a little more.
#pragma once
#include <algorithm>

#include "cpu/accel/split.h"
#include "luch/accel/primitives.h"

namespace luch::cpu {

constexpr int MAX_SLICES = 16;  // along an axis; fewer for small sets

// Boxes as in Corners: -lo x, y, z, (junk), hi x, y, z, (junk).
LUCH_FN f8 load_box(const PrimBox& p) { return load<f8>(&p); }
LUCH_FN f8 nothing() { return f8{} - INFINITE_DISTANCE; }
LUCH_FN float half_area(f8 box) {
    float x = box[0] + box[4], y = box[1] + box[5], z = box[2] + box[6];
    return x * y + y * z + z * x;
}
LUCH_FN bool is_empty(f8 box) {
    return !(box[0] + box[4] >= 0.0f && box[1] + box[5] >= 0.0f && box[2] + box[6] >= 0.0f);
}
LUCH_FN f8 united(f8 a, f8 b) { return max_of(a, b); }

class Clipper {
 public:
    explicit Clipper(const Primitives& all) : all_(all) {}

    // Cuts the ref's primitive at ascending planes: out[0] is the part below the first, out[count] that above the last,
    // each widened and within the box before.
    void cut(const PrimBox& ref, int axis, const float* planes, int count, f8* out) const;

 private:
    const Primitives& all_;
};

// Equal slices of a set's box along each axis.
struct Slices {
    f8 box[3][MAX_SLICES];
    u32 begin[3][MAX_SLICES] = {}, end[3][MAX_SLICES] = {};  // refs whose first or last slice it is
    Slices() { std::fill_n(&box[0][0], 3 * MAX_SLICES, nothing()); }
    void merge(const Slices& o) {
        for (int axis = 0; axis < 3; ++axis)
            for (int b = 0; b < MAX_SLICES; ++b) {
                box[axis][b] = united(box[axis][b], o.box[axis][b]);
                begin[axis][b] += o.begin[axis][b];
                end[axis][b] += o.end[axis][b];
            }
    }
};

class Slicing {
 public:
    Slicing(const PrimSet& set, const Clipper& clipper);
    bool usable(int axis) const { return usable_[axis]; }
    // Refs that end where a slice begins count for it.
    int slice_of(int axis, float x) const;
    void add(const PrimBox& ref, Slices* out) const;
    // The ref's parts below and above a slice's lower plane.
    void cut(const PrimBox& ref, int axis, int slice, f8* parts) const {
        clipper_.cut(ref, axis, planes_[axis] + slice, 1, parts);
    }

 private:
    const Clipper& clipper_;
    int slices_;
    float planes_[3][MAX_SLICES];  // the slices' lower planes
    float inverse_step_[3];
    bool usable_[3];
};

// Where a set is cut, and what that is expected to cost: area times refs of both sides.
struct Cut {
    float cost = INFINITE_DISTANCE;
    int axis = 0, bin = 0;  // first bin of the right side
    f8 left = nothing(), right = nothing();
    u32 left_count = 0, right_count = 0;
};

Cut choose_cut(const Slices& slices, const Slicing& slicing);

}  // namespace luch::cpu

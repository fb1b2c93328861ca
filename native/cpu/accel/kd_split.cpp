#include "cpu/accel/kd_split.h"

namespace luch::cpu {
namespace {

constexpr double STEP_COST = 1.0;         // one plane
constexpr double PRIMITIVE_COST = 1.3;    // one primitive test, in planes
constexpr double EMPTY_SIDE_FACTOR = 0.8; // a side without primitives makes the cut so much cheaper

// The least cost seen so far among the planes of a cell.
class Best {
 public:
    Best(const Box& cell, u32 count, u64 most_cut) : count_(count), most_cut_(most_cut) {
        for (int axis = 0; axis < 3; ++axis) size_[axis] = double(cell.hi[axis]) - double(cell.lo[axis]);
        half_area_ = size_[0] * size_[1] + size_[1] * size_[2] + size_[2] * size_[0];
        cost_ = half_area_ > 0 ? PRIMITIVE_COST * double(count) : -1;
    }
    void offer(int axis, float plane, double below_size, u32 below, u32 above) {
        if (u64(below) + above - count_ > most_cut_) return;
        double across = size_[(axis + 1) % 3] * size_[(axis + 2) % 3];
        double around = size_[(axis + 1) % 3] + size_[(axis + 2) % 3];
        double area_below = across + below_size * around;
        double area_above = across + (size_[axis] - below_size) * around;
        double cost = STEP_COST + PRIMITIVE_COST * (area_below * below + area_above * above) / half_area_;
        if (below == 0 || above == 0) cost *= EMPTY_SIDE_FACTOR;
        if (cost < cost_) {
            cost_ = cost;
            plane_ = {axis, plane};
        }
    }
    KdPlane plane() const { return plane_; }

 private:
    u32 count_;
    u64 most_cut_;
    double size_[3], half_area_, cost_;
    KdPlane plane_ = {-1, 0.0f};
};

}  // namespace

KdSettings kd_settings(BuildQuality quality) {
    switch (quality) {
        case BuildQuality::FAST:
            return {32, false, 4.0f};
        case BuildQuality::NORMAL:
            return {128, true, 12.0f};
        default:
            return {KD_MOST_EXACT, true, 24.0f};
    }
}

KdBins::KdBins(const Box& cell) : cell_(cell) {
    for (int axis = 0; axis < 3; ++axis) {
        float size = cell.hi[axis] - cell.lo[axis];
        scale_[axis] = size > 0.0f ? float(COUNT) / size : 0.0f;
        if (!finite_f(scale_[axis])) scale_[axis] = 0.0f;
    }
}

void KdBins::add(const KdRef* refs, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        const KdRef& r = refs[i];
        extend(used_, r.box());
        for (int axis = 0; axis < 3; ++axis) {
            int begin = int((r.lo[axis] - cell_.lo[axis]) * scale_[axis]);
            int end = int((r.hi[axis] - cell_.lo[axis]) * scale_[axis]);
            ++begins_[axis][begin < COUNT ? begin : COUNT - 1];
            ++ends_[axis][end < COUNT ? end : COUNT - 1];
        }
    }
}

void KdBins::add(const KdBins& other) {
    extend(used_, other.used_);
    for (int axis = 0; axis < 3; ++axis)
        for (int bin = 0; bin < COUNT; ++bin) {
            begins_[axis][bin] += other.begins_[axis][bin];
            ends_[axis][bin] += other.ends_[axis][bin];
        }
}

KdPlane KdBins::choose(u32 count, u64 most_cut) const {
    Best best(cell_, count, most_cut);
    for (int axis = 0; axis < 3; ++axis) {
        float lo = cell_.lo[axis], hi = cell_.hi[axis];
        auto offer = [&](float plane, u32 below, u32 above) {
            if (plane > lo && plane < hi) best.offer(axis, plane, double(plane) - double(lo), below, above);
        };
        offer(used_.lo[axis], 0, count);
        offer(used_.hi[axis], count, 0);
        u32 below = 0, above = count;
        for (int bin = 1; bin < COUNT; ++bin) {
            below += begins_[axis][bin - 1];
            above -= ends_[axis][bin - 1];
            offer(lo + (hi - lo) * (float(bin) / float(COUNT)), below, above);
        }
    }
    return best.plane();
}

KdPlane choose_exact_plane(const KdRef* refs, u32 count, const Box& cell, u64 most_cut) {
    alignas(64) float lo[KD_MOST_EXACT], hi[KD_MOST_EXACT];
    Best best(cell, count, most_cut);
    for (int axis = 0; axis < 3; ++axis) {
        float first = cell.lo[axis], last = cell.hi[axis];
        for (u32 i = 0; i < count; ++i) {
            lo[i] = refs[i].lo[axis];
            hi[i] = refs[i].hi[axis];
        }
        auto offer = [&](float plane) {
            if (!(plane > first && plane < last)) return;
            u32 above_or_flat = 0, above = 0;
            for (u32 i = 0; i < count; ++i) {
                above_or_flat += lo[i] >= plane;
                above += hi[i] > plane;
            }
            best.offer(axis, plane, double(plane) - double(first), count - above_or_flat, above);
        };
        for (u32 i = 0; i < count; ++i) {
            offer(lo[i]);
            if (hi[i] != lo[i]) offer(hi[i]);
        }
    }
    return best.plane();
}

}  // namespace luch::cpu

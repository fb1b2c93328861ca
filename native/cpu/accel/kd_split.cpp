#include "cpu/accel/kd_split.h"

namespace luch::cpu {
namespace {

constexpr double STEP_COST = 1.0;         // one plane
constexpr double PRIMITIVE_COST = 0.9;    // one primitive test, in planes
constexpr double EMPTY_SIDE_FACTOR = 0.8; // a side without primitives makes the cut so much cheaper

constexpr u32 LANES = 16;
typedef float Floats __attribute__((vector_size(4 * LANES)));
typedef i32 Ints __attribute__((vector_size(4 * LANES)));

// AVX-512 compares into a mask, by which it can add; others get -1 in every lane where it is true.
inline Ints one_more_where(Ints is_true, Ints count) {
#if defined(__AVX512F__)
    return is_true ? count + 1 : count;
#else
    return count - is_true;
#endif
}

// The least cost seen so far among the planes of a cell, in units of PRIMITIVE_COST per half of the cell's area.
class Best {
 public:
    Best(const Box& cell, u32 count, u64 most_cut, double patience) : most_sides_(most_cut + count) {
        double size[3];
        for (int axis = 0; axis < 3; ++axis) size[axis] = double(cell.hi[axis]) - double(cell.lo[axis]);
        for (int axis = 0; axis < 3; ++axis) {
            size_[axis] = size[axis];
            across_[axis] = size[(axis + 1) % 3] * size[(axis + 2) % 3];
            around_[axis] = size[(axis + 1) % 3] + size[(axis + 2) % 3];
        }
        double half_area = across_[0] + across_[1] + across_[2];
        step_ = STEP_COST / PRIMITIVE_COST * half_area;
        cost_ = half_area > 0 ? patience * half_area * double(count) : -1;
    }
    void offer(int axis, float plane, double below_size, u32 below, u32 above) {
        double both = double(below) + double(above);
        double cost = step_ + across_[axis] * both +
                      around_[axis] * (below_size * double(below) + (size_[axis] - below_size) * double(above));
        if (below == 0 || above == 0) cost *= EMPTY_SIDE_FACTOR;
        if (cost < cost_ && u64(below) + above <= most_sides_) {
            cost_ = cost;
            plane_ = {axis, plane};
        }
    }
    KdPlane plane() const { return plane_; }

 private:
    u64 most_sides_;
    double size_[3], across_[3], around_[3], step_, cost_;
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

KdPlane KdBins::choose(u32 count, u64 most_cut, float patience) const {
    Best best(cell_, count, most_cut, double(patience));
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

// Sixteen planes at a time, each compared with every ref.
KdPlane choose_exact_plane(const KdRef* refs, u32 count, const Box& cell, u64 most_cut) {
    float lo[KD_MOST_EXACT], hi[KD_MOST_EXACT];
    Floats planes[2 * KD_MOST_EXACT / LANES];
    Vec3 extent = cell.hi - cell.lo;
    float unit = 1.0f / max_component(extent);  // areas in units in which none overflows
    Vec3 size = extent * unit;
    if (!finite_f(unit) || count == 0) return {-1, 0.0f};
    float half_area = size.x * size.y + size.y * size.z + size.z * size.x;
    float step = float(STEP_COST / PRIMITIVE_COST) * half_area, leaf_cost = half_area * float(count);
    i32 most_sides = i32(most_cut < KD_MOST_EXACT ? most_cut : KD_MOST_EXACT) + i32(count);
    Floats least_cost = Floats{} + leaf_cost, best_plane = {};  // of the planes that a lane has seen
    Ints best_axis = Ints{} - 1;
    for (int axis = 0; axis < 3; ++axis) {
        float first = cell.lo[axis], last = cell.hi[axis], length = size[axis];
        float u = size[axis == 0 ? 1 : 0], v = size[axis == 2 ? 1 : 2], across = u * v, around = u + v;
        u32 blocks = (2 * count + LANES - 1) / LANES;
        for (u32 i = 0; i < blocks * LANES; ++i) planes[i / LANES][i % LANES] = first;  // past the end: no plane
        for (u32 i = 0; i < count; ++i) {
            lo[i] = refs[i].lo[axis];
            hi[i] = refs[i].hi[axis];
            planes[2 * i / LANES][2 * i % LANES] = lo[i];
            planes[2 * i / LANES][2 * i % LANES + 1] = hi[i];
        }
        for (u32 b = 0; b < blocks; ++b) {
            Floats plane = planes[b];
            Ints below = {}, above = {};
            for (u32 i = 0; i < count; ++i) {
                below = one_more_where(lo[i] < plane, below);
                above = one_more_where(hi[i] > plane, above);
            }
            Floats under = __builtin_convertvector(below, Floats), over = __builtin_convertvector(above, Floats);
            Floats x = (plane - first) * unit;
            Floats cost = step + across * (under + over) + around * (x * under + (length - x) * over);
            cost = ((below == 0) | (above == 0)) ? cost * float(EMPTY_SIDE_FACTOR) : cost;
            Ints better = (plane > first) & (plane < last) & (below + above <= most_sides) & (cost < least_cost);
            least_cost = better ? cost : least_cost;
            best_plane = better ? plane : best_plane;
            best_axis = better ? axis : best_axis;
        }
    }
    u32 best = 0;  // of equal ones the lower axis
    for (u32 k = 1; k < LANES; ++k)
        if (least_cost[k] < least_cost[best] ||
            (least_cost[k] == least_cost[best] && u32(best_axis[k]) < u32(best_axis[best])))
            best = k;
    return {best_axis[best], best_plane[best]};
}

}  // namespace luch::cpu

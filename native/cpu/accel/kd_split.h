// Where to cut a cell of a kd-tree: the plane of least expected cost (surface area heuristic, MacDonald and Booth 1990).
#pragma once
#include "cpu/accel/structure.h"
#include "luch/geometry/box.h"

namespace luch::cpu {

// A primitive in a cell: the box of its part there.
struct KdRef {
    Vec3 lo;
    u32 ref;
    Vec3 hi;
    u32 unused;
    Box box() const { return {lo, hi}; }
};
static_assert(sizeof(KdRef) == 32);
inline bool is_below(const KdRef& r, int axis, float plane) { return r.lo[axis] < plane || r.hi[axis] <= plane; }
inline bool is_above(const KdRef& r, int axis, float plane) { return r.hi[axis] > plane; }

struct KdSettings {
    u32 exact_below;  // cells of fewer primitives try every plane that bounds one, larger ones 64 bins
    bool clips;  // boxes of cut triangles are those of their parts
    float references;  // at most so many refs a primitive
};
KdSettings kd_settings(BuildQuality quality);

struct KdPlane {
    int axis;  // -1: a leaf is cheaper
    float plane;
};

// What 64 bins an axis know of a cell's refs; those of parts of the refs can be added up.
class KdBins {
 public:
    static constexpr int COUNT = 64;
    explicit KdBins(const Box& cell);
    void add(const KdRef* refs, size_t count);
    void add(const KdBins& other);
    // patience: a plane may cost so many times what no cut costs, where what is gained shows after the next cut only.
    KdPlane choose(u32 count, u64 most_cut, float patience) const;

 private:
    Box cell_;
    Box used_ = empty_box();
    float scale_[3];
    u32 begins_[3][COUNT] = {}, ends_[3][COUNT] = {};
};

// Tries both sides of each ref's box. count <= KD_MOST_EXACT. most_cut: refs that may stand on both sides.
inline constexpr u32 KD_MOST_EXACT = 512;
KdPlane choose_exact_plane(const KdRef* refs, u32 count, const Box& cell, u64 most_cut);

}  // namespace luch::cpu

// Sets of primitives, and how the builder cuts one in two: 16 bins an axis, the cut of least expected cost.
#pragma once
#include <vector>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/simd.h"

namespace luch::cpu {

// Corners as one vector: -lo x, y, z, (junk), hi x, y, z, (junk).
struct alignas(32) Corners {
    float v[8] = {-INFINITE_DISTANCE, -INFINITE_DISTANCE, -INFINITE_DISTANCE, -INFINITE_DISTANCE,
                  -INFINITE_DISTANCE, -INFINITE_DISTANCE, -INFINITE_DISTANCE, -INFINITE_DISTANCE};
    f8 get() const { return load<f8>(v); }
    void set(f8 x) { store(v, x); }
    void merge(const Corners& o) { set(max_of(get(), o.get())); }
    float extent(int axis) const { return v[axis] + v[axis + 4]; }
    float half_area() const {
        float x = extent(0), y = extent(1), z = extent(2);
        return x * y + y * z + z * x;
    }
};

struct PrimSet {
    u32 begin = 0, end = 0;
    u32 buffer = 0;     // which of the splitter's two buffers holds it
    Corners box;        // of the primitives
    Corners centroids;  // of the centres of their boxes
    u32 count() const { return end - begin; }
    float half_area() const { return box.half_area(); }
};

struct Split {
    bool leaf = false;   // not splitting is cheaper
    bool halve = false;  // no cut by bins: two halves in the order of the widest axis
    int axis = 0;
    int bin = 0;         // first bin of the right side
    u32 left_count = 0;
    Corners left, right;
};

PrimSet bound_all(const PrimBox* prims, size_t count, ThreadPool& pool);

class Splitter {
 public:
    static constexpr int BINS = 16;

    Splitter(PrimBox* a, PrimBox* b, u32 leaf_width, ThreadPool& pool)
        : buffers_{a, b}, leaf_width_(leaf_width), pool_(pool) {}
    const PrimBox* prims(const PrimSet& set) const { return buffers_[set.buffer]; }

    // parallel: with all threads of the pool; such calls come one at a time, find before its apply.
    Split find(const PrimSet& set, bool halve, bool parallel);
    void apply(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right, bool parallel);

 private:
    struct Bins {
        Corners box[3][BINS];
        u32 count[3][BINS] = {};
    };
    struct BinOf;  // maps a primitive to its bins

    u32 blocks(u32 count) const { return (count + leaf_width_ - 1) / leaf_width_; }
    static void fill(Bins& bins, const PrimBox* prims, u32 begin, u32 end, const BinOf& bin_of);
    Split choose(const PrimSet& set, const Bins& bins) const;
    void halve(const PrimSet& set, PrimSet* left, PrimSet* right);
    void partition(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right);
    void partition_parallel(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right);

    PrimBox* buffers_[2];
    u32 leaf_width_;
    ThreadPool& pool_;
    std::vector<Bins> chunk_bins_;  // of the last parallel find
};

}  // namespace luch::cpu

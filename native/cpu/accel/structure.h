// The structures of the race, over the primitives of one space. Each is a plain view (include/luch/accel) that the
// CPU and CUDA walk with the same functions, and a builder that fills its arrays. The eight-wide tree of the CPU
// (group.h) is apart: its blocks are made for this processor's vectors.
#pragma once
#include <cstddef>
#include <memory>
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/accel/primitives.h"

namespace luch::cpu {

// The closed list; names as in luch/accel.py.
enum class StructureKind : u32 { BRUTE_FORCE, GRID, HIERARCHICAL_GRID, BVH2, BVH2_STACKLESS, KD_TREE, CWBVH };
enum class BuildQuality : u32 { FAST, NORMAL, HIGH };  // Morton clusters; binned surface area; with spatial splits

// The primitives that can be traced: refs ascending, everything behind them finite. Lives as long as the structure.
struct StructureInput {
    Primitives primitives;
    const u32* refs;
    u32 count;  // may be 0
    BuildQuality quality;
};

// One array behind a view's pointer, for a device that needs its own copy.
struct StructureArray {
    const char* name;
    size_t view_offset;  // of the pointer in the view
    const void* data;
    size_t bytes;
};

struct StructureStats {
    u64 nodes = 0;       // or cells
    u64 references = 0;  // primitive refs stored, duplicates counted
    u64 bytes = 0;       // nodes and lists; not the primitives themselves
    u32 depth = 0;       // levels below the root
};

class Structure {
 public:
    virtual ~Structure() = default;
    // Rays are valid (ray_is_valid) with t_min >= 0; hits[i].t is the upper end. counters null: none are kept,
    // and the traversal is compiled without them; else those of all rays are added to it.
    virtual void closest(Precision precision, const Ray* rays, RefHit* hits, size_t count,
                         Counters* counters) const = 0;
    virtual void any(Precision precision, const Ray* rays, u8* blocked, size_t count, Counters* counters) const = 0;
    virtual StructureStats stats() const = 0;
    // The view's bytes and the arrays that its pointers mean.
    virtual const void* view(size_t* bytes) const = 0;
    virtual std::vector<StructureArray> arrays() const = 0;
};

std::unique_ptr<Structure> build_structure(StructureKind kind, const StructureInput& input, ThreadPool& pool);

// closest() and any() for a view that has closest_hit<P>(view, primitives, ray, best, counters) and any_hit<P>.
template <class View>
class StructureOf : public Structure {
 public:
    void closest(Precision precision, const Ray* rays, RefHit* hits, size_t count, Counters* counters) const override {
        choose(precision, counters, [&]<Precision P>(auto& kept) {
            for (size_t i = 0; i < count; ++i) closest_hit<P>(view_, primitives_, rays[i], &hits[i], kept);
        });
    }
    void any(Precision precision, const Ray* rays, u8* blocked, size_t count, Counters* counters) const override {
        choose(precision, counters, [&]<Precision P>(auto& kept) {
            for (size_t i = 0; i < count; ++i) blocked[i] = any_hit<P>(view_, primitives_, rays[i], kept);
        });
    }
    const void* view(size_t* bytes) const override {
        *bytes = sizeof(View);
        return &view_;
    }

 protected:
    explicit StructureOf(const Primitives& primitives) : primitives_(primitives) {}
    View view_ = {};
    Primitives primitives_;

 private:
    template <class Run>
    static void choose(Precision precision, Counters* counters, Run&& run) {
        NoCounters none;
        auto with = [&](auto& kept) {
            if (precision == Precision::FAST) return run.template operator()<Precision::FAST>(kept);
            if (precision == Precision::DOUBLE) return run.template operator()<Precision::DOUBLE>(kept);
            run.template operator()<Precision::WATERTIGHT>(kept);
        };
        if (counters)
            with(*counters);
        else
            with(none);
    }
};

// One builder a kind, each in its own file.
std::unique_ptr<Structure> build_brute_force(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_bvh2(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_bvh2_stackless(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_grid(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_hierarchical_grid(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_kd_tree(const StructureInput& input, ThreadPool& pool);
std::unique_ptr<Structure> build_cwbvh(const StructureInput& input, ThreadPool& pool);

}  // namespace luch::cpu

// The eight-wide tree: plain data. Built by build_bvh8.h, walked by traverse.h.
#pragma once
#include <cstddef>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

#include "luch/geometry/box.h"
#include "luch/platform.h"

namespace luch::cpu {

// A child is an inner node's index, or LEAF | (items - 1) << LEAF_COUNT_SHIFT | first item; an empty slot
// has a box that no ray enters. Items are blocks of four triangles, eight spheres or eight
// pieces of curves, or instances in the top level.
constexpr u32 LEAF = 0x80000000u;
constexpr u32 LEAF_COUNT_SHIFT = 28;
constexpr u32 LEAF_MAX_ITEMS = 8;
constexpr u32 LEAF_FIRST_MASK = (1u << LEAF_COUNT_SHIFT) - 1;
LUCH_FN u32 leaf_first(u32 leaf) { return leaf & LEAF_FIRST_MASK; }
LUCH_FN u32 leaf_items(u32 leaf) { return ((leaf >> LEAF_COUNT_SHIFT) & (LEAF_MAX_ITEMS - 1)) + 1; }

constexpr u32 MAX_DEPTH = 96;                        // wide levels; the builder halves sets below HALVING_DEPTH
constexpr u32 HALVING_DEPTH = 48;                    // 16 levels of halving by 8 hold 2^48 triangles
constexpr u32 STACK_SIZE = MAX_DEPTH * 7 + 16;       // every level leaves seven siblings; 16: slack of wide stores

struct alignas(64) Node8 {
    float bounds[6][8];  // lo x, y, z, hi x, y, z
    u32 child[8];
    u32 count[8];        // while building: triangles of a leaf, 0 for an inner child
};
static_assert(sizeof(Node8) == 256);

constexpr u32 REF_TRANSPARENT = 0x80000000u;  // the triangle may be transparent
constexpr u32 REF_MASK = 0x7fffffffu;         // index into the group's list; REF_MASK: empty lane

// Four triangles, one per lane. Empty lanes are NaN: no comparison accepts them.
struct alignas(32) Block4 {
    float vertex[3][3][4];  // vertex, axis, lane
    u32 ref[4];
};
static_assert(sizeof(Block4) == 160);

// Eight spheres. Empty lanes have radius 0, which is never hit.
struct alignas(32) SphereBlock {
    float center[3][8];
    float radius[8];  // as Sphere's
    u32 ref[8];
};
static_assert(sizeof(SphereBlock) == 160);

// Eight pieces of curves as capsules (geometry/curve.h). Empty lanes have no ref; their capsules are far away.
struct alignas(32) CurveBlock {
    float a[3][8], b[3][8];
    float radius[8];
    u32 ref[8];
};
static_assert(sizeof(CurveBlock) == 256);

// An array that asks for huge pages: incoherent rays then miss the TLB less.
template <class T>
class HugeArray {
 public:
    HugeArray() = default;
    explicit HugeArray(size_t size);
    HugeArray(HugeArray&& other) noexcept { swap(other); }
    HugeArray& operator=(HugeArray&& other) noexcept {
        swap(other);
        return *this;
    }
    ~HugeArray() { std::free(data_); }
    T* data() { return data_; }
    const T* data() const { return data_; }
    size_t size() const { return size_; }
    size_t bytes() const { return size_ * sizeof(T); }
    T& operator[](size_t i) { return data_[i]; }
    const T& operator[](size_t i) const { return data_[i]; }

 private:
    void swap(HugeArray& other) {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
    }
    T* data_ = nullptr;
    size_t size_ = 0;
};

void* allocate_huge(size_t bytes);  // 64-byte aligned or better, not initialised; throws std::bad_alloc

template <class T>
HugeArray<T>::HugeArray(size_t size) : data_(static_cast<T*>(allocate_huge(size * sizeof(T)))), size_(size) {}

}  // namespace luch::cpu

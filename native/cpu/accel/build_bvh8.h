// Top-down surface-area-heuristic builder (binned, Wald 2007) that makes eight-wide nodes at once: the child
// of largest area is split until there are eight. Parallel and deterministic: the tree depends on the boxes
// alone.
#pragma once
#include <cstddef>
#include <vector>

#include "cpu/accel/bvh8.h"
#include "cpu/thread_pool.h"

namespace luch::cpu {

// One primitive's box as the builder moves it about. Signs of lo are flipped: one max merges both corners.
struct alignas(32) PrimBox {
    float minus_lo[3];
    u32 id;
    float hi[3];
    u32 unused;
};
static_assert(sizeof(PrimBox) == 32);

struct Tree8 {
    HugeArray<Node8> nodes;  // depth first; child: node index, or (count > 0) first index into order
    std::vector<u32> order;  // primitive ids, leaf by leaf
    Box root;
};

// The same from a binary tree, cut at the least expected cost. Refs repeat where its builder split triangles.
struct Tree2;
Tree8 collapse_bvh8(const Tree2& tree, u32 leaf_width, ThreadPool& pool);

void set_empty_slot(Node8& node, int slot);

// leaf_width: primitives that cost one test together (4 for triangle blocks, 1 for instances). A leaf holds
// at most LEAF_MAX_ITEMS * leaf_width. boxes is consumed as scratch. count >= 1; every box finite.
Tree8 build_bvh8(HugeArray<PrimBox> boxes, size_t count, u32 leaf_width, ThreadPool& pool);

}  // namespace luch::cpu

// The builders of binary trees. What comes out is plain: the nodes of bvh2.h and the refs of their leaves. Other
// structures are made from it: depth first without a stack, or collapsed to wide nodes.
#pragma once
#include <vector>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/structure.h"
#include "luch/accel/bvh2.h"

namespace luch::cpu {

struct Tree2 {
    std::vector<Bvh2Node> nodes;  // 0 the root, 1 unused, then pairs, parents before children; none: nothing to hit
    std::vector<u32> refs;        // leaf by leaf; spatial splits repeat some
    Box root = empty_box();
    u32 depth = 0;                // levels below the root, at most BVH2_MAX_DEPTH
};

// A leaf holds at most max_leaf refs, and fewer where splitting is cheaper.
Tree2 build_tree2(const StructureInput& input, u32 max_leaf, ThreadPool& pool);

// Its parts, one a quality.
Tree2 build_tree2_binned(HugeArray<PrimBox> boxes, size_t count, u32 max_leaf, ThreadPool& pool);

HugeArray<PrimBox> gather_prim_boxes(const StructureInput& input, ThreadPool& pool);

}  // namespace luch::cpu

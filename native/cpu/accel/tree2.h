// The builders of binary trees. What comes out is plain: the nodes of bvh2.h and the refs of their leaves. Other
// structures are made from it: depth first without a stack, or collapsed to wide nodes.
#pragma once
#include <functional>
#include <vector>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/structure.h"
#include "luch/accel/bvh2.h"

namespace luch::cpu {

struct Tree2 {
    std::vector<Bvh2Node> nodes;  // 0 the root, 1 unused, then pairs; none: nothing to hit
    std::vector<u32> refs;        // leaf by leaf; spatial splits repeat some
    Box root = empty_box();
    u32 depth = 0;                // levels below the root, at most BVH2_MAX_DEPTH
};

// A leaf holds at most max_leaf refs, and fewer where splitting is cheaper. cost: what a tree is worth to the caller,
// where a quality has two to choose from; by itself, the boxes and primitives that a ray is expected to meet.
using TreeCost = std::function<double(const Tree2&)>;
Tree2 build_tree2(const StructureInput& input, u32 max_leaf, ThreadPool& pool, const TreeCost& cost = {});

// Its parts, one a quality. count > 0.
//
// NORMAL: binned surface area (Wald 2007). Below halving_level sets are cut in halves: 31 levels more at most.
constexpr u32 HALVING_LEVEL = BVH2_MAX_DEPTH - 32;
Tree2 build_tree2_binned(HugeArray<PrimBox> boxes, size_t count, u32 max_leaf, u32 halving_level, ThreadPool& pool);
// HIGH: the same with spatial splits (Stich, Friedrich, Dietrich 2009), where that is better in the end. At most
// MAX_REPEATED of the refs are added.
constexpr float MAX_REPEATED = 0.5f;
Tree2 build_tree2_spatial(const StructureInput& input, const HugeArray<PrimBox>& boxes, u32 max_leaf, ThreadPool& pool);
// FAST: neighbours along a Morton curve, merged bottom up (Meister, Bittner 2018); the top is binned. Leaves hold one ref.
Tree2 build_tree2_clusters(HugeArray<PrimBox> boxes, size_t count, ThreadPool& pool);

// A subtree that one thread built, for a place among the nodes of the top.
struct Subtree {
    u32 at;
    std::vector<Bvh2Node> nodes;  // 0: its root; then pairs; a leaf's child counts from refs, or from the tree's own
    std::vector<u32> refs;
    u32 depth = 0;                // in the whole tree
};
void append_subtrees(Tree2& top, const std::vector<Subtree>& subtrees, ThreadPool& pool);

}  // namespace luch::cpu

// The nodes of a compressed wide tree over anything that has boxes: who asks for them makes the leaves.
#pragma once
#include <vector>

#include "cpu/accel/collapse.h"
#include "luch/accel/cwbvh.h"

namespace luch::cpu {

struct CwbvhNodes {
    std::vector<CwbvhNode> nodes;
    std::vector<u32> refs;  // of the leaves, in order
    u32 depth = 0;
};

// tree: not empty; costs.max_leaf at most CWBVH_LEAF. Throws std::length_error if no walk may go so deep.
CwbvhNodes build_cwbvh_nodes(const Tree2& tree, const Collapse::Costs& costs, ThreadPool& pool);

}  // namespace luch::cpu

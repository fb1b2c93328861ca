// From a binary tree to one of eight children a node, at the least expected cost: of all ways to cut the tree, the
// best is found by dynamic programming from the leaves up (Ylitie, Karras, Laine 2017, 3.2).
#pragma once
#include <vector>

#include "cpu/accel/tree2.h"

namespace luch::cpu {

struct WideChild {
    u32 node;   // of the binary tree
    bool leaf;  // all below it in one leaf
};

class Collapse {
 public:
    struct Costs {
        float node, primitive;  // of a visit and of a test
        u32 max_leaf;           // primitives; the tree's own leaves hold no more
        u32 leaf_width = 1;     // primitives that cost one test together
    };
    Collapse(const Tree2& tree, const Costs& costs, ThreadPool& pool);

    // Expected work of a ray that meets the root, times the root's area.
    double cost() const { return double(best_[0].cost[0]) / double(scale_) / double(scale_); }
    // The children of the wide node that a binary node becomes; the root may be a leaf, then it is its own child.
    int children(u32 node, WideChild* out) const;
    u32 primitives_below(u32 node) const { return best_[node].primitives; }
    // The refs below a node, each once, ascending; at most max_leaf.
    u32 refs_below(u32 node, u32* out) const;

 private:
    struct Best {
        float cost[7];       // as a forest of at most 1..7 trees
        u8 left[8];  // of at most 2..7 and exactly 8: how many of them come from the left; 0: one fewer is as good
        bool leaf;  // as one tree: a leaf
        u32 primitives;  // below
    };
    float leaf_cost(u32 primitives) const {
        return float((primitives + costs_.leaf_width - 1) / costs_.leaf_width) * costs_.primitive;
    }
    void solve(u32 node);
    void solve_below(u32 node);
    void gather(u32 node, u32 most, WideChild* out, int* count) const;

    const Tree2& tree_;
    Costs costs_;
    float scale_;
    std::vector<Best> best_;
};

}  // namespace luch::cpu

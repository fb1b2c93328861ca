// The eight-wide tree of vectors, out of a binary one.
#include <algorithm>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/collapse.h"

namespace luch::cpu {
namespace {

// In visits of a node: a test of four triangles costs about as much as a visit of eight boxes.
constexpr float NODE_COST = 1.0f, BLOCK_COST = 1.0f;
static_assert(BVH2_MAX_DEPTH <= MAX_DEPTH);  // a wide level takes at least one of the binary tree

class Widen {
 public:
    Widen(const Tree2& tree, const Collapse& collapse, u32 leaf_width)
        : tree_(tree), collapse_(collapse), most_(LEAF_MAX_ITEMS * leaf_width) {}

    void run() {
        struct Open {
            u32 node, parent, slot;
        };
        std::vector<Open> open = {{0, NONE, 0}};
        while (!open.empty()) {
            Open next = open.back();
            open.pop_back();
            u32 index = u32(nodes.size());
            nodes.emplace_back();
            if (next.parent != NONE) nodes[next.parent].child[next.slot] = index;
            WideChild children[8];
            int count = collapse_.children(next.node, children);
            sort_by_area(children, count);
            for (int i = 0; i < 8; ++i) set_empty_slot(nodes[index], i);
            for (int i = count - 1; i >= 0; --i)  // the last pushed is the next made: depth first
                if (!children[i].leaf) open.push_back({children[i].node, index, u32(i)});
            for (int i = 0; i < count; ++i) fill(nodes[index], i, children[i]);
        }
    }
    std::vector<Node8> nodes;
    std::vector<u32> order;

 private:
    void fill(Node8& node, int slot, const WideChild& child) {
        const Bvh2Node& from = tree_.nodes[child.node];
        for (int axis = 0; axis < 3; ++axis) {
            node.bounds[axis][slot] = from.lo[axis];
            node.bounds[axis + 3][slot] = from.hi[axis];
        }
        node.child[slot] = 0;
        if (!child.leaf) return;
        size_t first = order.size();
        order.resize(first + 2 * size_t(most_));  // repeated refs go
        u32 count = collapse_.refs_below(child.node, order.data() + first);
        order.resize(first + count);
        node.child[slot] = u32(first);
        node.count[slot] = count;
    }
    // Large children first, as in the direct builder.
    void sort_by_area(WideChild* children, int count) const {
        auto area = [&](const WideChild& c) {
            const Bvh2Node& n = tree_.nodes[c.node];
            float x = n.hi[0] - n.lo[0], y = n.hi[1] - n.lo[1], z = n.hi[2] - n.lo[2];
            return x * y + y * z + z * x;
        };
        std::stable_sort(children, children + count,
                         [&](const WideChild& a, const WideChild& b) { return area(a) > area(b); });
    }

    const Tree2& tree_;
    const Collapse& collapse_;
    u32 most_;
};

}  // namespace

Tree8 collapse_bvh8(const Tree2& tree, u32 leaf_width, ThreadPool& pool) {
    Collapse collapse(tree, {NODE_COST, BLOCK_COST, 4 * leaf_width, leaf_width}, pool);
    Widen widen(tree, collapse, leaf_width);
    widen.run();
    Tree8 out;
    out.root = tree.root;
    out.order = std::move(widen.order);
    out.nodes = HugeArray<Node8>(widen.nodes.size());
    std::copy(widen.nodes.begin(), widen.nodes.end(), out.nodes.data());
    return out;
}

}  // namespace luch::cpu

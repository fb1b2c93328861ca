// The binary trees with and without a stack, from the same builders.
#include "luch/accel/bvh2.h"

#include "cpu/accel/structure.h"
#include "cpu/accel/tree2.h"
#include "luch/accel/bvh2_stackless.h"

namespace luch::cpu {
namespace {

constexpr u32 MAX_LEAF = 8;  // refs

template <class View, class Node>
class BinaryTree final : public StructureOf<View> {
 public:
    BinaryTree(const Primitives& primitives, std::vector<Node> nodes, Tree2& tree)
        : StructureOf<View>(primitives), nodes_(std::move(nodes)), refs_(std::move(tree.refs)), depth_(tree.depth) {
        this->view_ = {nodes_.data(), refs_.data(), tree.root, u32(nodes_.size())};
    }
    StructureStats stats() const override {
        return {nodes_.size(), refs_.size(), nodes_.size() * sizeof(Node) + refs_.size() * sizeof(u32), depth_};
    }
    std::vector<StructureArray> arrays() const override {
        return {{"nodes", offsetof(View, nodes), nodes_.data(), nodes_.size() * sizeof(Node)},
                {"refs", offsetof(View, refs), refs_.data(), refs_.size() * sizeof(u32)}};
    }

 private:
    std::vector<Node> nodes_;
    std::vector<u32> refs_;
    u32 depth_;
};

std::vector<SkipNode> depth_first(const std::vector<Bvh2Node>& nodes) {
    std::vector<SkipNode> out;
    if (nodes.empty()) return out;
    out.reserve(nodes.size() - 1);
    struct Open {
        u32 node;    // NONE: the subtree of `placed` is complete
        u32 placed;
    };
    std::vector<Open> open = {{0, NONE}};
    while (!open.empty()) {
        auto [node, placed] = open.back();
        open.pop_back();
        u32 here = u32(out.size());
        if (node == NONE) {
            out[placed].link = here;
            continue;
        }
        const Bvh2Node& n = nodes[node];
        out.push_back({{n.lo[0], n.lo[1], n.lo[2]}, n.child, {n.hi[0], n.hi[1], n.hi[2]}, n.count});
        if (n.count != 0) continue;
        open.push_back({NONE, here});
        open.push_back({n.child + 1, NONE});
        open.push_back({n.child, NONE});
    }
    return out;
}

}  // namespace

std::unique_ptr<Structure> build_bvh2(const StructureInput& input, ThreadPool& pool) {
    Tree2 tree = build_tree2(input, MAX_LEAF, pool);
    std::vector<Bvh2Node> nodes = std::move(tree.nodes);
    return std::make_unique<BinaryTree<Bvh2, Bvh2Node>>(input.primitives, std::move(nodes), tree);
}

std::unique_ptr<Structure> build_bvh2_stackless(const StructureInput& input, ThreadPool& pool) {
    Tree2 tree = build_tree2(input, MAX_LEAF, pool);
    std::vector<SkipNode> nodes = depth_first(tree.nodes);
    return std::make_unique<BinaryTree<Bvh2Stackless, SkipNode>>(input.primitives, std::move(nodes), tree);
}

}  // namespace luch::cpu

// Binary trees: the choice of the builder, and what the builders share.
#include <algorithm>

#include "cpu/accel/slivers.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 16384;  // primitives a thread takes at once

// Expected boxes and primitives of a ray that meets the root, relative to the root's area.
double expected_cost(const Tree2& tree) {
    double cost = 0.0;
    for (const Bvh2Node& n : tree.nodes) {
        double x = double(n.hi[0]) - double(n.lo[0]), y = double(n.hi[1]) - double(n.lo[1]),
               z = double(n.hi[2]) - double(n.lo[2]);
        cost += (x * y + y * z + z * x) * (n.count == 0 ? 1.0 : double(n.count));
    }
    return cost;
}

// Cutting primitives pays at once where it is done, but may cost more below: keep what is better in the end.
Tree2 build_best(const StructureInput& input, HugeArray<PrimBox> boxes, u32 max_leaf, ThreadPool& pool,
                 const TreeCost& cost) {
    Tree2 cut = build_tree2_spatial(input, boxes, max_leaf, pool);
    size_t count = boxes.size();
    Tree2 sorted = build_tree2_binned(std::move(boxes), count, max_leaf, HALVING_LEVEL, pool);
    return cost(cut) < cost(sorted) ? std::move(cut) : std::move(sorted);
}

}  // namespace

// Behind the top, in order of the subtrees.
void append_subtrees(Tree2& tree, const std::vector<Subtree>& subtrees, ThreadPool& pool) {
    std::vector<u32> first(subtrees.size() + 1), first_ref(subtrees.size() + 1);
    first[0] = u32(tree.nodes.size());
    first_ref[0] = u32(tree.refs.size());
    for (size_t i = 0; i < subtrees.size(); ++i) {
        first[i + 1] = first[i] + u32(subtrees[i].nodes.size()) - 1;
        first_ref[i + 1] = first_ref[i] + u32(subtrees[i].refs.size());
        tree.depth = std::max(tree.depth, subtrees[i].depth);
    }
    tree.nodes.resize(first.back());
    tree.refs.resize(first_ref.back());
    pool.parallel_for(subtrees.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            const Subtree& s = subtrees[i];
            std::copy(s.refs.begin(), s.refs.end(), tree.refs.begin() + first_ref[i]);
            u32 leaf_offset = s.refs.empty() ? 0 : first_ref[i];
            for (u32 n = 0; n < s.nodes.size(); ++n) {
                Bvh2Node node = s.nodes[n];
                node.child += node.count == 0 ? first[i] - 1 : leaf_offset;
                tree.nodes[n == 0 ? s.at : first[i] + n - 1] = node;
            }
        }
    });
    const Bvh2Node& root = tree.nodes[0];
    tree.root = {{root.lo[0], root.lo[1], root.lo[2]}, {root.hi[0], root.hi[1], root.hi[2]}};
}

Tree2 build_tree2(const StructureInput& input, u32 max_leaf, ThreadPool& pool, const TreeCost& cost) {
    if (input.count == 0) return {};
    size_t count = input.count;
    HugeArray<PrimBox> boxes = cut_slivers(input.primitives, boxes_of(input, pool), &count, pool);
    if (input.quality == BuildQuality::FAST) return build_tree2_clusters(std::move(boxes), count, pool);
    if (input.quality == BuildQuality::HIGH)
        return build_best(input, std::move(boxes), max_leaf, pool, cost ? cost : expected_cost);
    return build_tree2_binned(std::move(boxes), count, max_leaf, HALVING_LEVEL, pool);
}

}  // namespace luch::cpu

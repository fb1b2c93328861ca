// Binned surface-area splits, top down: with all threads while sets are large, one thread a set below.
#include <algorithm>

#include "cpu/accel/split.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 TASK_REFS = 16384;     // smaller sets are built by one thread each

struct Task {
    PrimSet set;
    u32 level;
};

class Builder {
 public:
    Builder(PrimBox* a, PrimBox* b, u32* refs, u32 max_leaf, u32 halving_level, ThreadPool& pool)
        : split_(a, b, 1, pool), refs_(refs), max_leaf_(max_leaf), halving_level_(halving_level) {}

    // nodes[at] is there already. tasks: where sets are left that one thread should build; null: here.
    void grow(std::vector<Bvh2Node>& nodes, u32 at, const PrimSet& set, u32 level, u32* depth, std::vector<Task>* tasks,
              std::vector<Subtree>* subtrees) {
        bool parallel = tasks != nullptr;
        *depth = std::max(*depth, level);
        if (parallel && set.count() <= TASK_REFS) {
            tasks->push_back({set, level});
            subtrees->push_back({at, {}, {}});
            return;
        }
        Bvh2Node& node = nodes[at];
        for (int axis = 0; axis < 3; ++axis) {
            node.lo[axis] = -set.box.v[axis];
            node.hi[axis] = set.box.v[axis + 4];
        }
        bool small = set.count() <= max_leaf_, deep = level >= halving_level_;
        Split split;
        bool leaf = set.count() == 1 || (small && deep);
        if (!leaf) {
            split = split_.find(set, deep, parallel);
            leaf = small && split.leaf;
        }
        if (leaf) {
            node.child = set.begin;
            node.count = set.count();
            const PrimBox* prims = split_.prims(set);
            for (u32 i = set.begin; i < set.end; ++i) refs_[i] = prims[i].id;
            return;
        }
        u32 pair = u32(nodes.size());
        node.child = pair;
        node.count = 0;
        nodes.resize(nodes.size() + 2);
        PrimSet left, right;
        split_.apply(set, split, &left, &right, parallel);
        grow(nodes, pair, left, level + 1, depth, tasks, subtrees);
        grow(nodes, pair + 1, right, level + 1, depth, tasks, subtrees);
    }

 private:
    Splitter split_;
    u32* refs_;
    u32 max_leaf_, halving_level_;
};

}  // namespace

Tree2 build_tree2_binned(HugeArray<PrimBox> boxes, size_t count, u32 max_leaf, u32 halving_level, ThreadPool& pool) {
    HugeArray<PrimBox> scratch(count);
    Tree2 tree;
    tree.refs.resize(count);
    tree.nodes.resize(2);
    PrimSet all = bound_all(boxes.data(), count, pool);
    Builder builder(boxes.data(), scratch.data(), tree.refs.data(), max_leaf, halving_level, pool);
    std::vector<Task> tasks;
    std::vector<Subtree> subtrees;
    builder.grow(tree.nodes, 0, all, 0, &tree.depth, &tasks, &subtrees);
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            Subtree& s = subtrees[i];
            s.nodes.reserve(tasks[i].set.count());
            s.nodes.resize(1);
            builder.grow(s.nodes, 0, tasks[i].set, tasks[i].level, &s.depth, nullptr, nullptr);
        }
    });
    append_subtrees(tree, subtrees, pool);
    return tree;
}

}  // namespace luch::cpu

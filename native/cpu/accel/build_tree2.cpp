// Binned surface-area splits, top down: with all threads while sets are large, one thread a set below.
#include <algorithm>
#include <stdexcept>

#include "cpu/accel/split.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 16384;         // primitives a thread takes at once
constexpr u32 TASK_REFS = 16384;     // smaller sets are built by one thread each
constexpr u32 HALVING_LEVEL = 64;    // below it sets are halved: 2^31 refs need 31 levels more
static_assert(HALVING_LEVEL + 31 <= BVH2_MAX_DEPTH);

struct Task {
    PrimSet set;
    u32 level;
    u32 node;                     // its root, among the top nodes
    std::vector<Bvh2Node> nodes;  // 0: the root again; then pairs
    u32 depth = 0;
};

class Builder {
 public:
    Builder(PrimBox* a, PrimBox* b, u32* refs, u32 max_leaf, ThreadPool& pool)
        : split_(a, b, 1, pool), refs_(refs), max_leaf_(max_leaf) {}

    // nodes[at] is there already. tasks: where sets are left that one thread should build; null: here.
    void grow(std::vector<Bvh2Node>& nodes, u32 at, const PrimSet& set, u32 level, std::vector<Task>* tasks,
              u32* depth) {
        bool parallel = tasks != nullptr;
        *depth = std::max(*depth, level);
        if (parallel && set.count() <= TASK_REFS) {
            tasks->push_back({set, level, at, {}});
            return;
        }
        Bvh2Node& node = nodes[at];
        for (int axis = 0; axis < 3; ++axis) {
            node.lo[axis] = -set.box.v[axis];
            node.hi[axis] = set.box.v[axis + 4];
        }
        bool small = set.count() <= max_leaf_, deep = level >= HALVING_LEVEL;
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
        grow(nodes, pair, left, level + 1, tasks, depth);
        grow(nodes, pair + 1, right, level + 1, tasks, depth);
    }

 private:
    Splitter split_;
    u32* refs_;
    u32 max_leaf_;
};

// The tasks' nodes behind the top ones, in order of the tasks.
void append(std::vector<Bvh2Node>& top, const std::vector<Task>& tasks, ThreadPool& pool) {
    std::vector<u32> first(tasks.size() + 1);
    first[0] = u32(top.size());
    for (size_t i = 0; i < tasks.size(); ++i) first[i + 1] = first[i] + u32(tasks[i].nodes.size()) - 1;
    top.resize(first.back());
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i)
            for (u32 n = 0; n < tasks[i].nodes.size(); ++n) {
                Bvh2Node node = tasks[i].nodes[n];
                if (node.count == 0) node.child += first[i] - 1;
                top[n == 0 ? tasks[i].node : first[i] + n - 1] = node;
            }
    });
}

Box box_of(const Bvh2Node& node) {
    return {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
}

}  // namespace

HugeArray<PrimBox> gather_prim_boxes(const StructureInput& input, ThreadPool& pool) {
    HugeArray<PrimBox> boxes(input.count);
    pool.parallel_for(input.count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            Box b = primitive_box(input.primitives, input.refs[i]);
            boxes[i] = {{-b.lo.x, -b.lo.y, -b.lo.z}, input.refs[i], {b.hi.x, b.hi.y, b.hi.z}, 0};
        }
    });
    return boxes;
}

Tree2 build_tree2_binned(HugeArray<PrimBox> boxes, size_t count, u32 max_leaf, ThreadPool& pool) {
    HugeArray<PrimBox> scratch(count);
    Tree2 tree;
    tree.refs.resize(count);
    tree.nodes.resize(2);
    PrimSet all = bound_all(boxes.data(), count, pool);
    Builder builder(boxes.data(), scratch.data(), tree.refs.data(), max_leaf, pool);
    std::vector<Task> tasks;
    builder.grow(tree.nodes, 0, all, 0, &tasks, &tree.depth);
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            tasks[i].nodes.reserve(tasks[i].set.count());
            tasks[i].nodes.resize(1);
            builder.grow(tasks[i].nodes, 0, tasks[i].set, tasks[i].level, nullptr, &tasks[i].depth);
        }
    });
    append(tree.nodes, tasks, pool);
    for (const Task& task : tasks) tree.depth = std::max(tree.depth, task.depth);
    tree.root = box_of(tree.nodes[0]);
    return tree;
}

Tree2 build_tree2(const StructureInput& input, u32 max_leaf, ThreadPool& pool) {
    if (input.count == 0) return {};
    switch (input.quality) {
        case BuildQuality::NORMAL:
            return build_tree2_binned(gather_prim_boxes(input, pool), input.count, max_leaf, pool);
        default:
            throw std::invalid_argument("Trees of this quality are not in this build.");
    }
}

}  // namespace luch::cpu

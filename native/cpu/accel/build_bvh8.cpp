#include "cpu/accel/build_bvh8.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstring>

#include "cpu/accel/split.h"

namespace luch::cpu {

void* allocate_huge(size_t bytes) {
    constexpr size_t HUGE_PAGE = size_t(2) << 20;
    size_t alignment = bytes >= HUGE_PAGE ? HUGE_PAGE : 64;
    size_t rounded = (std::max<size_t>(bytes, 1) + alignment - 1) / alignment * alignment;
    void* data = std::aligned_alloc(alignment, rounded);
    if (!data) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
    if (bytes >= HUGE_PAGE) madvise(data, rounded, MADV_HUGEPAGE);  // advice: failure changes nothing but speed
#endif
    return data;
}

void set_empty_slot(Node8& node, int slot) {
    for (int axis = 0; axis < 3; ++axis) {
        node.bounds[axis][slot] = INFINITE_DISTANCE;
        node.bounds[axis + 3][slot] = -INFINITE_DISTANCE;
    }
    node.child[slot] = LEAF;
    node.count[slot] = 0;
}

namespace {

constexpr size_t TASK_PRIMITIVES = 16384;  // smaller sets are built by one thread each

struct Child {
    PrimSet set;
    Split split;
    bool split_known;
    bool leaf;  // cheaper as it is, or too small to split
};

struct Task {
    Child child;
    u32 depth;
    u32 parent_node, slot;
    std::vector<Node8> nodes;
};

void set_bounds(Node8& node, int slot, const PrimSet& set) {
    for (int axis = 0; axis < 3; ++axis) {
        node.bounds[axis][slot] = -set.box.v[axis];
        node.bounds[axis + 3][slot] = set.box.v[axis + 4];
    }
}

// Large children first: shadow rays, which stop at any hit, then meet them first.
void sort_by_area(const Child* children, int count, int* order) {
    float area[8];
    for (int i = 0; i < count; ++i) {
        float own = children[i].set.half_area();
        int place = i;
        for (; place > 0 && area[place - 1] < own; --place) {
            area[place] = area[place - 1];
            order[place] = order[place - 1];
        }
        area[place] = own;
        order[place] = i;
    }
}

class Builder {
 public:
    Builder(PrimBox* a, PrimBox* b, u32* order, u32 leaf_width, ThreadPool& pool)
        : split_(a, b, leaf_width, pool), order_(order), leaf_width_(leaf_width) {}

    // The top of the tree, with all threads in each split; sets below TASK_PRIMITIVES become tasks.
    void build_top(const PrimSet& set, u32 depth, std::vector<Node8>& nodes, std::vector<Task>& tasks) {
        build({set, {}, false, set.count() <= leaf_width_}, depth, nodes, &tasks);
    }
    void build_task(Task& task) {
        task.nodes.reserve(task.child.set.count() / 3 + 4);
        build(task.child, task.depth, task.nodes, nullptr);
    }

 private:
    u32 build(const Child& root, u32 depth, std::vector<Node8>& nodes, std::vector<Task>* tasks) {
        u32 index = static_cast<u32>(nodes.size());
        nodes.emplace_back();
        Child children[8];
        int count = split_into_children(root, depth, children, tasks != nullptr);
        int order[8];
        sort_by_area(children, count, order);
        Node8 node;
        for (int i = 0; i < 8; ++i) set_empty_slot(node, i);
        for (int i = 0; i < count; ++i) {
            const Child& child = children[order[i]];
            set_bounds(node, i, child.set);
            if (child.leaf) {
                node.child[i] = child.set.begin;
                node.count[i] = child.set.count();
                write_order(child.set);
            } else if (tasks && child.set.count() <= TASK_PRIMITIVES) {
                tasks->push_back({child, depth + 1, index, u32(i), {}});
            } else {
                node.child[i] = build(child, depth + 1, nodes, tasks);
            }
        }
        nodes[index] = node;
        return index;
    }

    int split_into_children(const Child& root, u32 depth, Child* children, bool parallel) {
        int count = 1;
        children[0] = root;
        while (count < 8) {
            int widest = -1;
            for (int i = 0; i < count; ++i)
                if (!children[i].leaf && (widest < 0 || children[i].set.half_area() > children[widest].set.half_area()))
                    widest = i;
            if (widest < 0) break;
            Child& child = children[widest];
            know_split(child, depth, parallel);
            if (child.leaf) continue;
            PrimSet left, right;
            split_.apply(child.set, child.split, &left, &right, parallel);
            child = {left, {}, false, left.count() <= leaf_width_};
            children[count++] = {right, {}, false, right.count() <= leaf_width_};
        }
        // A small set that is cheaper unsplit becomes a leaf here, not a node with one leaf below.
        for (int i = 0; i < count; ++i)
            if (!children[i].leaf && children[i].set.count() <= LEAF_MAX_ITEMS * leaf_width_)
                know_split(children[i], depth + 1, parallel);
        return count;
    }

    void know_split(Child& child, u32 depth, bool parallel) {
        if (child.split_known) return;
        child.split = split_.find(child.set, depth >= HALVING_DEPTH, parallel);
        child.split_known = true;
        child.leaf = child.split.leaf;
    }

    void write_order(const PrimSet& set) {
        const PrimBox* prims = split_.prims(set);
        for (u32 i = set.begin; i < set.end; ++i) order_[i] = prims[i].id;
        std::sort(order_ + set.begin, order_ + set.end);
    }

    Splitter split_;
    u32* order_;
    u32 leaf_width_;
};

// Top nodes first, then each task's nodes in order: depth first up to the tasks.
HugeArray<Node8> join(const std::vector<Node8>& top, const std::vector<Task>& tasks, ThreadPool& pool) {
    std::vector<u32> first(tasks.size() + 1);
    first[0] = static_cast<u32>(top.size());
    for (size_t i = 0; i < tasks.size(); ++i) first[i + 1] = first[i] + static_cast<u32>(tasks[i].nodes.size());
    HugeArray<Node8> nodes(first.back());
    std::copy(top.begin(), top.end(), nodes.data());
    for (size_t i = 0; i < tasks.size(); ++i) nodes[tasks[i].parent_node].child[tasks[i].slot] = first[i];
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i)
            for (size_t n = 0; n < tasks[i].nodes.size(); ++n) {
                Node8& node = nodes[first[i] + n];
                node = tasks[i].nodes[n];
                for (int slot = 0; slot < 8; ++slot)
                    if (node.count[slot] == 0 && node.child[slot] != LEAF) node.child[slot] += first[i];
            }
    });
    return nodes;
}

}  // namespace

Tree8 build_bvh8(HugeArray<PrimBox> boxes, size_t count, u32 leaf_width, ThreadPool& pool) {
    HugeArray<PrimBox> scratch(count);
    Tree8 tree;
    tree.order.resize(count);
    PrimSet all = bound_all(boxes.data(), count, pool);
    tree.root = {make_vec3(-all.box.v[0], -all.box.v[1], -all.box.v[2]),
                 make_vec3(all.box.v[4], all.box.v[5], all.box.v[6])};
    Builder builder(boxes.data(), scratch.data(), tree.order.data(), leaf_width, pool);
    std::vector<Node8> top;
    std::vector<Task> tasks;
    builder.build_top(all, 0, top, tasks);
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) builder.build_task(tasks[i]);
    });
    tree.nodes = join(top, tasks, pool);
    return tree;
}

}  // namespace luch::cpu

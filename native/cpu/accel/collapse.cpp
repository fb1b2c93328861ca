#include "cpu/accel/collapse.h"

#include <algorithm>

namespace luch::cpu {
namespace {

constexpr u32 LEAST_SUBTREES = 64;  // solved side by side

float half_area(const Bvh2Node& node, float scale) {
    float x = (node.hi[0] - node.lo[0]) * scale, y = (node.hi[1] - node.lo[1]) * scale,
          z = (node.hi[2] - node.lo[2]) * scale;
    return x * y + y * z + z * x;
}

}  // namespace

Collapse::Collapse(const Tree2& tree, const Costs& costs, ThreadPool& pool) : tree_(tree), costs_(costs) {
    float extent = max_component(tree.root.hi - tree.root.lo);
    scale_ = 1.0f / std::clamp(extent, 1e-37f, 1e37f);  // areas of huge trees stay finite
    best_.resize(tree.nodes.size());
    std::vector<u32> top = {0}, roots = {0};  // level by level: those above, and the subtrees left
    while (roots.size() < LEAST_SUBTREES) {
        std::vector<u32> next;
        for (u32 node : roots)
            if (tree.nodes[node].count == 0) {
                next.push_back(tree.nodes[node].child);
                next.push_back(tree.nodes[node].child + 1);
            }
        if (next.empty()) break;
        top.insert(top.end(), next.begin(), next.end());
        roots = std::move(next);
    }
    pool.parallel_for(roots.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) solve_below(roots[i]);
    });
    for (size_t i = top.size(); i-- > 0;) solve(top[i]);  // children stand behind their parents
}

void Collapse::solve_below(u32 node) {
    if (tree_.nodes[node].count == 0) {
        solve_below(tree_.nodes[node].child);
        solve_below(tree_.nodes[node].child + 1);
    }
    solve(node);
}

void Collapse::solve(u32 node) {
    const Bvh2Node& n = tree_.nodes[node];
    Best& best = best_[node];
    best = {};
    float area = half_area(n, scale_);
    if (n.count != 0) {
        best.primitives = n.count;
        best.leaf = true;
        std::fill_n(best.cost, 7, area * leaf_cost(n.count));
        return;
    }
    const Best &l = best_[n.child], &r = best_[n.child + 1];
    best.primitives = l.primitives + r.primitives;
    float forest[9];
    u8 from_left[9];
    for (u32 most = 2; most <= 8; ++most) {
        forest[most] = INFINITE_DISTANCE;
        from_left[most] = 1;
        for (u32 k = std::max(most, 8u) - 7; k < most; ++k) {
            if (k > 7 || most - k > 7) continue;
            float cost = l.cost[k - 1] + r.cost[most - k - 1];
            if (cost < forest[most]) {
                forest[most] = cost;
                from_left[most] = u8(k);
            }
        }
    }
    float inner = forest[8] + area * costs_.node;
    best.left[7] = from_left[8];
    best.cost[0] = inner;
    if (best.primitives <= costs_.max_leaf) {
        float as_leaf = area * leaf_cost(best.primitives);
        best.leaf = as_leaf <= inner;
        best.cost[0] = std::min(as_leaf, inner);
    }
    for (u32 most = 2; most <= 7; ++most) {
        bool apart = forest[most] < best.cost[most - 2];
        best.cost[most - 1] = apart ? forest[most] : best.cost[most - 2];
        best.left[most - 1] = apart ? from_left[most] : u8(0);
    }
}

void Collapse::gather(u32 node, u32 most, WideChild* out, int* count) const {
    const Best& best = best_[node];
    while (most > 1 && best.left[most - 1] == 0) --most;
    if (most == 1) {
        out[(*count)++] = {node, best.leaf};
        return;
    }
    u32 left = best.left[most - 1], child = tree_.nodes[node].child;
    gather(child, left, out, count);
    gather(child + 1, most - left, out, count);
}

int Collapse::children(u32 node, WideChild* out) const {
    int count = 0;
    if (best_[node].leaf) {
        out[count++] = {node, true};
        return count;
    }
    u32 left = best_[node].left[7], child = tree_.nodes[node].child;
    gather(child, left, out, &count);
    gather(child + 1, 8 - left, out, &count);
    return count;
}

u32 Collapse::refs_below(u32 node, u32* out) const {
    const Bvh2Node& n = tree_.nodes[node];
    u32 count = 0;
    if (n.count != 0) {
        std::copy_n(tree_.refs.begin() + n.child, n.count, out);
        count = n.count;
    } else {
        count = refs_below(n.child, out);
        count += refs_below(n.child + 1, out + count);
    }
    std::sort(out, out + count);
    return u32(std::unique(out, out + count) - out);
}

}  // namespace luch::cpu

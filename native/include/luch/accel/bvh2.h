// A binary tree of boxes walked with a stack: the nearer child first, the farther one waits.
#pragma once
#include "luch/accel/slabs.h"

namespace luch {

// 32 bytes; two siblings share a cache line.
struct Bvh2Node {
    float lo[3];
    u32 child;  // inner: the first of two neighbours; leaf: its first place in refs
    float hi[3];
    u32 count;  // refs of a leaf; 0: inner
};

struct Bvh2 {
    const Bvh2Node* nodes;  // 0: the root; 1: nothing, so that pairs begin at even places
    const u32* refs;
    Box root;
    u32 node_count;  // 0: nothing to hit
};

inline constexpr u32 BVH2_MAX_DEPTH = 96;  // levels below the root, and so entries of a stack: builders keep to it

// Calls leaf(first, count) for every leaf that the ray may hit before leaf.t_max(), until it returns true.
template <class Leaf, class Count>
LUCH_FN void walk(const Bvh2& tree, const BoxRay& ray, float t_min, Leaf& leaf, Count& count) {
    struct Waiting {
        u32 node;
        float enter;
    } stack[BVH2_MAX_DEPTH];
    u32 waiting = 0, at = 0;
    float enter;
    if (tree.node_count == 0) return;
    count.node(sizeof(Bvh2Node), 1);
    if (!enter_box(ray, tree.nodes[0].lo, tree.nodes[0].hi, t_min, leaf.t_max(), &enter)) return;
    for (;;) {
        Bvh2Node node = tree.nodes[at];
        if (node.count != 0) {
            if (leaf(node.child, node.count)) return;
        } else {
            const Bvh2Node* pair = tree.nodes + node.child;
            float enter_left, enter_right;
            count.node(2 * sizeof(Bvh2Node), 2);
            bool left = enter_box(ray, pair[0].lo, pair[0].hi, t_min, leaf.t_max(), &enter_left);
            bool right = enter_box(ray, pair[1].lo, pair[1].hi, t_min, leaf.t_max(), &enter_right);
            if (left || right) {
                bool right_first = right && (!left || enter_right < enter_left);
                at = node.child + u32(right_first);
                if (left && right)
                    stack[waiting++] = {node.child + u32(!right_first), right_first ? enter_left : enter_right};
                continue;
            }
        }
        do {
            if (waiting == 0) return;
            --waiting;
        } while (stack[waiting].enter > leaf.t_max());
        at = stack[waiting].node;
    }
}

template <Precision P, class All, class Count>
LUCH_FN void closest_hit(const Bvh2& tree, const All& all, const Ray& ray, RefHit* best, Count& count) {
    ClosestInLeaf<P, Count, All> leaf = {all, tree.refs, PrimitiveRay<P>(ray), ray.t_min, best, count};
    walk(tree, slab_ray<P>(ray, tree.root), ray.t_min, leaf, count);
}

template <Precision P, class All, class Count>
LUCH_FN u8 any_hit(const Bvh2& tree, const All& all, const Ray& ray, Count& count) {
    AnyInLeaf<P, Count, All> leaf = {all, tree.refs, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count};
    walk(tree, slab_ray<P>(ray, tree.root), ray.t_min, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

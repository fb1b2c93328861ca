// The same binary tree without a stack: nodes depth first, each knowing where to go on when the ray misses it. The
// order is always left to right, so far boxes are entered before near ones: simple and small, and slower. (Smits
// 1998, "Efficiency Issues for Ray Tracing"; the lecture's stackless tree.)
#pragma once
#include "luch/accel/slabs.h"

namespace luch {

struct SkipNode {
    float lo[3];
    u32 link;  // inner: the node after this one's whole subtree; leaf: its first place in refs
    float hi[3];
    u32 count;  // refs of a leaf, then the next node follows; 0: inner
};

struct Bvh2Stackless {
    const SkipNode* nodes;
    const u32* refs;
    Box root;
    u32 node_count;
};

template <class Leaf, class Count>
LUCH_FN void walk(const Bvh2Stackless& tree, const BoxRay& ray, float t_min, Leaf& leaf, Count& count) {
    for (u32 at = 0; at < tree.node_count;) {
        SkipNode node = tree.nodes[at];
        float enter;
        count.node(sizeof(SkipNode), 1);
        bool entered = enter_box(ray, node.lo, node.hi, t_min, leaf.t_max(), &enter);
        bool inner = node.count == 0;
        at = inner && !entered ? node.link : at + 1;
        if (entered && !inner && leaf(node.link, node.count)) return;
    }
}

template <Precision P, class Count>
LUCH_FN void closest_hit(const Bvh2Stackless& tree, const Primitives& all, const Ray& ray, RefHit* best, Count& count) {
    ClosestInLeaf<P, Count> leaf = {all, tree.refs, PrimitiveRay<P>(ray), ray.t_min, best, count};
    walk(tree, slab_ray<P>(ray, tree.root), ray.t_min, leaf, count);
}

template <Precision P, class Count>
LUCH_FN u8 any_hit(const Bvh2Stackless& tree, const Primitives& all, const Ray& ray, Count& count) {
    AnyInLeaf<P, Count> leaf = {all, tree.refs, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count};
    walk(tree, slab_ray<P>(ray, tree.root), ray.t_min, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

// The kd-tree: space is cut by planes, a primitive stands in every cell that it touches. Nodes of 8 bytes.
//
// The ray is the cone of math/bounds.h, 1: some point Q of every hit lies in it at t and in the primitive's widened
// box. Going along the axis, the cone may still be on the near side of a plane until (plane - far_origin) far_rdir
// and may be beyond it from (plane - near_origin) near_rdir (BoxRay, box.h); both sides are visited where the two
// overlap, so the cell that holds Q is. All t here are what the primitive's test reports: the rdirs hold its rounding.
// A cell that begins exactly at the best t is visited still: it may hold a smaller ref.
#pragma once
#include "luch/accel/cell_refs.h"

namespace luch {

// Inner: link = (node above the plane) << 2 | axis, the node below comes next; value = the plane's float bits.
// Leaf: link = (first ref) << 2 | KD_LEAF; value = the number of refs.
struct KdNode {
    u32 link, value;
};
inline constexpr u32 KD_LEAF = 3;
inline constexpr u32 KD_MAX_LINK = (1u << 30) - 1;
inline constexpr u32 KD_MAX_DEPTH = 60;  // planes on the way to any leaf

struct KdTree {
    const KdNode* nodes;  // at least one
    const u32* refs;
    Box root;
};

// A part of the ray in a node that is still to be visited. path: one bit, of the node's depth (KdShortStack).
struct KdSpan {
    u32 node;
    float t0, t1;
    u64 path;
};
inline constexpr u64 KD_ROOT_PATH = u64(1) << 63;

// Room for every node that can wait.
struct KdStack {
    static constexpr bool RESTARTS = false;
    u32 size = 0, node[KD_MAX_DEPTH];
    float t0[KD_MAX_DEPTH], t1[KD_MAX_DEPTH];
    LUCH_FN void push(const KdSpan& s) {
        node[size] = s.node;
        t0[size] = s.t0;
        t1[size] = s.t1;
        ++size;
    }
    LUCH_FN bool near_is_done(u64) const { return false; }
    LUCH_FN bool pop(const KdSpan&, KdSpan* next) {
        if (size == 0) return false;
        --size;
        *next = {node[size], t0[size], t1[size], 0};
        return true;
    }
};

// The last COUNT nodes that wait; if more did, the ray starts again at the root and is led back by its trail:
// a bit a depth (the root's is the highest) that says the near child is done (Laine 2010, restart trail).
template <u32 COUNT>
struct KdShortStack {
    static constexpr bool RESTARTS = true;
    static_assert((COUNT & (COUNT - 1)) == 0, "a ring of a power of two");
    u32 size = 0, node[COUNT];
    float t0[COUNT], t1[COUNT];
    u64 done = 0, waiting = 0;  // depths whose near child is done, whose far child waits
    LUCH_FN u32 top() const { return u32(popcount(u32(waiting)) + popcount(u32(waiting >> 32))) & (COUNT - 1); }
    LUCH_FN void push(const KdSpan& s) {
        u32 k = top();
        node[k] = s.node;
        t0[k] = s.t0;
        t1[k] = s.t1;
        size = size < COUNT ? size + 1 : COUNT;
        waiting |= s.path << 1;
    }
    LUCH_FN bool near_is_done(u64 path) const { return (done & path) != 0; }
    LUCH_FN bool pop(const KdSpan& root, KdSpan* next) {
        if (waiting == 0) return false;
        u64 deepest = waiting & (0 - waiting);
        done = (done | deepest) & (0 - deepest);  // what lies deeper begins anew
        if (size > 0) {
            waiting ^= deepest;
            --size;
            u32 k = top();
            *next = {node[k], t0[k], t1[k], deepest >> 1};  // the last that was pushed is the deepest that waits
        } else {
            waiting = 0;
            *next = root;
        }
        return true;
    }
};

// Offers the refs of the cells along the ray, near to far, to leaf (cell_refs.h).
template <class Stack, class Leaf, class Count>
LUCH_FN void walk_kd_tree(const KdTree& tree, const Ray& ray, Leaf& leaf, Count& count) {
    BoxRay box = make_box_ray(ray.origin, ray.direction, tree.root);
    KdSpan root = {0, ray.t_min, leaf.limit(), KD_ROOT_PATH};
    if (!clip_to_box(box, tree.root, &root.t0, &root.t1)) return;
    Stack stack;
    KdSpan at = root;
    do {
        at.t1 = min_f(leaf.limit(), at.t1);
        if (at.t0 > at.t1) continue;
        KdNode node = tree.nodes[at.node];
        bool alive = true;
        while ((node.link & 3u) != KD_LEAF) {
            count.node(sizeof(KdNode), 1);
            u32 axis = node.link & 3u, below = at.node + 1, above = node.link >> 2;
            float plane = bits_float(node.value);
            float t_near = (plane - box.near_origin[axis]) * box.near_rdir[axis];
            float t_far = (plane - box.far_origin[axis]) * box.far_rdir[axis];
            bool negative = box.negative[axis] != 0;
            u32 first = negative ? above : below, second = negative ? below : above;
            bool beyond = !(t_near > at.t1);  // NaN: the ray lies in the plane and visits both sides
            u64 path = Stack::RESTARTS ? at.path >> 1 : 0;
            if (at.t0 > t_far) {
                at.node = second;
            } else if (Stack::RESTARTS && stack.near_is_done(at.path)) {
                if (!(alive = beyond)) break;
                at.node = second;
                at.t0 = max_f(t_near, at.t0);
            } else {
                if (beyond) {
                    stack.push({second, max_f(t_near, at.t0), at.t1, path});
                    at.t1 = min_f(t_far, at.t1);
                }
                at.node = first;
            }
            at.path = path;
            node = tree.nodes[at.node];
        }
        if (!alive) continue;
        count.node(sizeof(KdNode), 0);
        if (leaf.offer(tree.refs + (node.link >> 2), node.value)) return;
    } while (stack.pop(root, &at));
}

template <Precision P, class Stack = KdStack, class Count>
LUCH_FN void closest_hit(const KdTree& tree, const Primitives& all, const Ray& ray, RefHit* best, Count& count) {
    ClosestInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, best, count, {}};
    walk_kd_tree<Stack>(tree, ray, leaf, count);
}

template <Precision P, class Stack = KdStack, class Count>
LUCH_FN u8 any_hit(const KdTree& tree, const Primitives& all, const Ray& ray, Count& count) {
    AnyInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count, {}};
    walk_kd_tree<Stack>(tree, ray, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

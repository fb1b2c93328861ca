// The compressed wide tree of Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through
// Compressed Wide BVHs": eight children in 80 bytes, their boxes in steps of the node's own grid, their order of
// visit given by their places. The stack holds groups: a node's children that wait, or primitives that wait.
#pragma once
#include "luch/accel/primitives.h"
#include "luch/accel/wide_ray.h"

namespace luch {

// Bytes of words lie lowest first. A child's meta byte: 0 empty; inner 0b00100000 | 24 + place; leaf: its primitives
// in unary (1, 3, 7) << 5 | the first of them, counted from first_leaf.
struct alignas(16) CwbvhNode {
    float grid[3];
    u32 exponents;                      // biased exponent of the step: x, y, z; last byte: places that are inner
    u32 first_child, first_leaf;        // inner children and primitives follow each other in order of their places
    u32 meta[2];                        // a byte a place
    u32 lo[3][2], hi[3][2];             // planes by axis
};
static_assert(sizeof(CwbvhNode) == 80);

// A primitive where its leaf needs it: triangle a, b, c; sphere centre a, radius b[0]; of a curve's piece the capsule a, b,
// c[0], the rest is fetched where the ray comes near that.
enum LeafKind : u32 { LEAF_TRIANGLE, LEAF_SPHERE, LEAF_PIECE };
struct alignas(16) LeafPrimitive {
    float a[3];
    u32 ref;
    float b[3];
    u32 kind;   // LeafKind
    float c[3];
    u32 flags;  // PrimitiveFlag
};
static_assert(sizeof(LeafPrimitive) == 48);

template <class Leaf>
struct CwbvhOf {
    const CwbvhNode* nodes;
    const Leaf* leaves;
    Box root;
    u32 node_count, depth;  // levels of nodes below the root
};
using Cwbvh = CwbvhOf<LeafPrimitive>;

inline constexpr u32 CWBVH_LEAF = 3;         // primitives
inline constexpr u32 CWBVH_MAX_DEPTH = 96;   // and so entries of a stack; twice as many where leaves are postponed

// Children of a node or primitives that wait. hits: bits 31..24 children, in order of visit, with `inner` below; or
// bits 23..0 primitives from `first`.
struct WaitingGroup {
    u32 first, hits;
};
LUCH_FN bool has_nodes(WaitingGroup group) { return group.hits > 0x00ffffffu; }

// The plain stack. A kernel may bring its own, with its first entries in shared memory, and postpone leaves.
template <u32 SIZE = CWBVH_MAX_DEPTH>
struct LocalStack {
    WaitingGroup entries[SIZE];
    u32 size = 0;
    LUCH_FN void push(WaitingGroup group) { entries[size++] = group; }
    LUCH_FN WaitingGroup pop() { return entries[--size]; }
    LUCH_FN bool empty() const { return size == 0; }
    LUCH_FN static bool postpones_leaves() { return false; }  // true: too few rays of the warp are at leaves
};

// Bits of what the ray may hit in a node up to the distance `last`: 31..24 children, 23..0 primitives. The ray's lower
// end does not count: it is mostly 0, and then no box is entered before it.
LUCH_FN u32 intersect_children(const CwbvhNode& node, const WideRay& ray, float last) {
    WidePlanes planes;
    for (int axis = 0; axis < 3; ++axis)
        prepare_axis(ray, axis, node.grid[axis], node.exponents >> (8 * axis) & 0xffu, &planes);
    u32 order = (7u - ray.octant) * 0x01010101u, hits = 0;
    for (int half = 0; half < 2; ++half) {
        u32 meta = node.meta[half];
        u32 inner = ((meta & meta << 1) >> 4 & 0x01010101u) * 0xffu;  // 255 for inner children
        u32 bit = meta ^ (order & inner);                             // the lower five of each byte
        u32 near_plane[3], far_plane[3];
        for (int axis = 0; axis < 3; ++axis) {
            bool negative = ray.negative(axis);
            near_plane[axis] = negative ? node.hi[axis][half] : node.lo[axis][half];
            far_plane[axis] = negative ? node.lo[axis][half] : node.hi[axis][half];
        }
        for (u32 i = 0; i < 4; ++i) {
            float enter[3], leave[3];
            for (int axis = 0; axis < 3; ++axis) {
                float near_byte = byte_above_32768(near_plane[axis], i, ray.byte_bias);
                float far_byte = byte_above_32768(far_plane[axis], i, ray.byte_bias);
                enter[axis] = fused(near_byte, planes.near_step[axis], planes.near_base[axis]);
                leave[axis] = fused(far_byte, planes.far_step[axis], planes.far_base[axis]);
            }
            float from = largest_or_zero(enter[0], enter[1], enter[2]);
            float to = smaller(smallest(leave[0], leave[1], leave[2]), last);
            u32 unary = meta >> (8 * i + 5) & 7u;
            if (!(from > to)) hits |= unary << (bit >> (8 * i) & 31u);  // NaN: entered
        }
    }
    return hits;
}

// Calls leaf(item) for all that the ray may hit before leaf.t_max(), until it returns true.
template <class Item, class Stack, class Leaf, class Count>
LUCH_FN void walk(const CwbvhOf<Item>& tree, const WideRay& ray, Stack& stack, Leaf& leaf, Count& count) {
    if (tree.node_count == 0) return;
    WaitingGroup group = {0, 0x80000000u};
    float last = ray.upper(leaf.t_max());
    for (;;) {
        WaitingGroup leaves = {group.first, group.hits & 0x00ffffffu};
        if (has_nodes(group)) {
            u32 bit = u32(highest_bit(group.hits)), place = (bit - 24u) ^ (7u - ray.octant);
            u32 index = group.first + u32(popcount(group.hits & 0xffu & ~(~0u << place)));
            group.hits &= ~(1u << bit);
            if (has_nodes(group)) stack.push(group);
            const CwbvhNode node = tree.nodes[index];
            count.node(sizeof(CwbvhNode), 8);
            u32 hits = intersect_children(node, ray, last);
            group = {node.first_child, (hits & 0xff000000u) | node.exponents >> 24};
            leaves = {node.first_leaf, hits & 0x00ffffffu};
        } else {
            group.hits = 0;
        }
        while (leaves.hits != 0) {
            if (has_nodes(group) && stack.postpones_leaves()) {
                stack.push(leaves);
                break;
            }
            u32 bit = u32(highest_bit(leaves.hits));
            leaves.hits &= ~(1u << bit);
            if (leaf(tree.leaves[leaves.first + bit])) return;
            last = ray.upper(leaf.t_max());
        }
        if (has_nodes(group)) continue;
        if (stack.empty()) return;
        group = stack.pop();
    }
}

// curves: those of the tree's group.
template <Precision P, class Count>
LUCH_FN bool test_leaf(const LeafPrimitive& p, const CurveSet& curves, const PrimitiveRay<P>& ray, float t_min,
                       float t_max, TriangleHit* hit, Count& count) {
    count.primitive(sizeof(LeafPrimitive));
    if (plan::CURVES && p.kind == LEAF_PIECE) {
        if (!line_may_touch({vec3_of(p.a), vec3_of(p.b), p.c[0]}, ray.origin, ray.direction)) return false;
        return test_piece<P>(curves, p.ref, ray.origin, ray.direction, t_min, t_max, hit);
    }
    if (!plan::SPHERES || p.kind == LEAF_TRIANGLE)
        return ray.triangle(vec3_of(p.a), vec3_of(p.b), vec3_of(p.c), t_min, t_max, hit);
    hit->u = hit->v = 0.0f;
    return intersect_sphere<P>(ray.origin, ray.direction, {vec3_of(p.a), p.b[0]}, t_min, t_max, &hit->t);
}

template <Precision P, class Count>
struct ClosestOfLeaves {
    const CurveSet& curves;
    PrimitiveRay<P> ray;
    float t_min;
    RefHit* best;
    Count& count;
    LUCH_FN float t_max() const { return best->t; }
    LUCH_FN bool operator()(const LeafPrimitive& stored) {
        const LeafPrimitive p = stored;
        TriangleHit hit;
        if (test_leaf(p, curves, ray, t_min, best->t, &hit, count) && is_closer(hit.t, p.ref, *best))
            *best = {hit.t, p.ref, hit.u, hit.v};
        return false;
    }
};
template <Precision P, class Count>
struct AnyOfLeaves {
    const CurveSet& curves;
    PrimitiveRay<P> ray;
    float t_min, limit;
    u8 blocked;
    Count& count;
    LUCH_FN float t_max() const { return limit; }
    LUCH_FN bool operator()(const LeafPrimitive& stored) {
        const LeafPrimitive p = stored;
        TriangleHit hit;
        if (!test_leaf(p, curves, ray, t_min, limit, &hit, count)) return false;
        bool maybe = p.flags & PRIMITIVE_MAY_BE_TRANSPARENT;
        blocked = maybe ? u8(BLOCKED_MAYBE) : u8(BLOCKED_OPAQUE);
        return !maybe;
    }
};

template <Precision P, class Count>
LUCH_FN void closest_hit(const Cwbvh& tree, const Primitives& all, const Ray& ray, RefHit* best, Count& count) {
    LocalStack<> stack;
    ClosestOfLeaves<P, Count> leaf = {all.curves, PrimitiveRay<P>(ray), ray.t_min, best, count};
    walk(tree, make_wide_ray(ray, tree.root), stack, leaf, count);
}
// Of the primitives only curves are asked for: the rest lies in the tree's own leaves.
template <Precision P, class Count>
LUCH_FN u8 any_hit(const Cwbvh& tree, const Primitives& all, const Ray& ray, Count& count) {
    LocalStack<> stack;
    AnyOfLeaves<P, Count> leaf = {all.curves, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count};
    walk(tree, make_wide_ray(ray, tree.root), stack, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

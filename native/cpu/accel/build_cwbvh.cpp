// The compressed wide tree: collapsed from a binary one, its boxes rounded outwards to each node's grid (wide_ray.h).
#include "cpu/accel/build_cwbvh.h"

#include <cmath>

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 16384;  // leaf primitives a thread takes at once
constexpr u32 TASK_PRIMITIVES = 16384;  // smaller subtrees are made by one thread each
// One node is eight boxes, decoded: two to three tests of a triangle in double.
constexpr Collapse::Costs COSTS = {1.0f, 0.4f, CWBVH_LEAF};

void set_byte(u32* words, int place, u32 value) { words[place / 4] |= value << (8 * (place % 4)); }

// The places of children: for each of the eight octants of directions, the order of places is the order of visit, so
// a child should lie towards its place's corner. Greedy: the pair that lies farthest out first.
void choose_places(const Tree2& tree, const Bvh2Node& parent, const WideChild* children, int count, int* place) {
    float along[8][8];
    for (int c = 0; c < count; ++c) {
        const Bvh2Node& child = tree.nodes[children[c].node];
        float offset[3];
        for (int axis = 0; axis < 3; ++axis)
            offset[axis] =
                0.5f * child.lo[axis] - 0.5f * parent.lo[axis] + 0.5f * child.hi[axis] - 0.5f * parent.hi[axis];
        for (int p = 0; p < 8; ++p)
            along[c][p] =
                (p & 4 ? offset[0] : -offset[0]) + (p & 2 ? offset[1] : -offset[1]) + (p & 1 ? offset[2] : -offset[2]);
    }
    bool placed[8] = {}, taken[8] = {};
    for (int round = 0; round < count; ++round) {
        int best_child = -1, best_place = -1;
        for (int c = 0; c < count; ++c)
            for (int p = 0; p < 8 && !placed[c]; ++p)
                if (!taken[p] && (best_child < 0 || along[c][p] > along[best_child][best_place])) {
                    best_child = c;
                    best_place = p;
                }
        placed[best_child] = taken[best_place] = true;
        place[best_child] = best_place;
    }
}

// One axis of a node's grid, and its children's planes in it.
class AxisGrid {
 public:
    AxisGrid(float lo, float hi) : lo_(lo), usable_(hi - lo <= WIDEST) {
        int exponent = 0;
        std::frexp((double(hi) - double(lo)) / 253.0, &exponent);
        exponent_ = std::max(u32(std::max(exponent + 127, 0)), SMALLEST_STEP);
        place();
    }
    u32 exponent() const { return exponent_; }
    float grid() const { return grid_; }
    // False: the child does not fit, take coarser().
    bool planes(float lo, float hi, u32* q_lo, u32* q_hi) const {
        *q_lo = 0;
        *q_hi = 255;
        if (!usable_) return true;
        double below = std::floor(steps(lo) - double(PLANE_MARGIN)),
               above = std::ceil(steps(hi) + double(PLANE_MARGIN));
        if (!(below >= 0.0 && above <= 255.0)) return false;
        *q_lo = u32(below);
        *q_hi = u32(above);
        return true;
    }
    void coarser() {
        ++exponent_;
        place();
    }

 private:
    double step() const { return std::ldexp(1.0, int(exponent_) - 127); }
    double steps(float plane) const { return (double(plane) - double(grid_)) / step() - double(PLANE_BIAS); }
    void place() {
        double exact = double(lo_) - (double(PLANE_BIAS) + 2.0 * double(PLANE_MARGIN)) * step();
        grid_ = float(exact);
        if (double(grid_) > exact) grid_ = next_down(grid_);
        if (!usable_) {
            exponent_ = 127;
            grid_ = bits_float(0x7fc00000u);
        }
    }
    float lo_;
    bool usable_;
    u32 exponent_;
    float grid_;
};

void quantise(const Tree2& tree, const Bvh2Node& parent, const WideChild* children, int count, const int* place,
              CwbvhNode* out) {
    for (int axis = 0; axis < 3; ++axis) {
        AxisGrid grid(parent.lo[axis], parent.hi[axis]);
        u32 lo[8], hi[8];
        for (int c = 0; c < count; ++c) {
            const Bvh2Node& child = tree.nodes[children[c].node];
            if (grid.planes(child.lo[axis], child.hi[axis], &lo[c], &hi[c])) continue;
            grid.coarser();
            c = -1;  // all again
        }
        out->grid[axis] = grid.grid();
        out->exponents |= grid.exponent() << (8 * axis);
        for (int c = 0; c < count; ++c) {
            set_byte(out->lo[axis], place[c], lo[c]);
            set_byte(out->hi[axis], place[c], hi[c]);
        }
    }
}

// A wide node that is still to be made of a binary one.
struct Open {
    u32 from, to, level;
};

// Makes nodes below those that are open, out.nodes[open.to] each. later: where those of few primitives are left; null:
// none are.
void make_nodes(const Tree2& tree, const Collapse& collapse, std::vector<Open> open, std::vector<Open>* later,
                CwbvhNodes* out) {
    while (!open.empty()) {
        Open o = open.back();
        open.pop_back();
        if (later && collapse.primitives_below(o.from) <= TASK_PRIMITIVES) {
            later->push_back(o);
            continue;
        }
        out->depth = std::max(out->depth, o.level);
        WideChild children[8];
        int place[8], at[8], count = collapse.children(o.from, children);
        choose_places(tree, tree.nodes[o.from], children, count, place);
        for (int& c : at) c = -1;
        for (int c = 0; c < count; ++c) at[place[c]] = c;
        CwbvhNode node = {};
        node.first_child = u32(out->nodes.size());
        node.first_leaf = u32(out->refs.size());
        u32 inner = 0;
        for (int p = 0; p < 8; ++p) {
            if (at[p] < 0) continue;
            const WideChild& child = children[at[p]];
            if (!child.leaf) {
                set_byte(node.meta, p, 0x20u | (24u + u32(p)));
                node.exponents |= 1u << (24 + p);
                open.push_back({child.node, node.first_child + inner++, o.level + 1});
                continue;
            }
            u32 refs[CWBVH_LEAF], size = collapse.refs_below(child.node, refs);
            set_byte(node.meta, p, ((1u << size) - 1u) << 5 | (u32(out->refs.size()) - node.first_leaf));
            out->refs.insert(out->refs.end(), refs, refs + size);
        }
        quantise(tree, tree.nodes[o.from], children, count, place, &node);
        out->nodes.resize(out->nodes.size() + inner);
        out->nodes[o.to] = node;
    }
}

// Puts a subtree behind the others, its root where the top left room for it.
void append(const CwbvhNodes& part, u32 root, CwbvhNodes* out) {
    u32 nodes = u32(out->nodes.size()) - 1, refs = u32(out->refs.size());  // its root is not among them
    out->nodes.insert(out->nodes.end(), part.nodes.begin() + 1, part.nodes.end());
    out->refs.insert(out->refs.end(), part.refs.begin(), part.refs.end());
    out->nodes[root] = part.nodes[0];
    auto move = [&](CwbvhNode& node) {
        node.first_child += nodes;
        node.first_leaf += refs;
    };
    move(out->nodes[root]);
    for (size_t n = nodes + 1; n < out->nodes.size(); ++n) move(out->nodes[n]);
    out->depth = std::max(out->depth, part.depth);
}

LeafPrimitive leaf_primitive(const Primitives& all, u32 ref) {
    LeafPrimitive out = {};
    out.ref = ref;
    out.flags = all.flags ? all.flags[ref] : 0;
    if (is_piece(all, ref)) {
        Capsule c = piece_capsule(all.curves, piece_of(all, ref));
        out.kind = LEAF_PIECE;
        for (int k = 0; k < 3; ++k) {
            out.a[k] = c.a[k];
            out.b[k] = c.b[k];
        }
        out.c[0] = c.radius;
        return out;
    }
    bool sphere = ref >= all.triangle_count;
    out.kind = sphere ? LEAF_SPHERE : LEAF_TRIANGLE;
    const float* p = sphere ? all.spheres + 4 * u64(ref - all.triangle_count) : all.corners + 9 * u64(ref);
    for (int k = 0; k < 3; ++k) {
        out.a[k] = p[k];
        out.b[k] = sphere ? (k == 0 ? p[3] : 0.0f) : p[3 + k];
        out.c[k] = sphere ? 0.0f : p[6 + k];
    }
    return out;
}

class CompressedTree final : public StructureOf<Cwbvh> {
 public:
    CompressedTree(const StructureInput& input, ThreadPool& pool) : StructureOf(input.primitives) {
        auto cost = [&](const Tree2& t) { return Collapse(t, COSTS, pool).cost(); };
        Tree2 tree = build_tree2(input, 1, pool, cost);
        view_.root = tree.root;
        if (tree.nodes.empty()) return;
        CwbvhNodes wide = build_cwbvh_nodes(tree, COSTS, pool);
        nodes_ = HugeArray<CwbvhNode>(wide.nodes.size());
        std::copy(wide.nodes.begin(), wide.nodes.end(), nodes_.data());
        leaves_ = HugeArray<LeafPrimitive>(wide.refs.size());
        pool.parallel_for(wide.refs.size(), CHUNK, [&](size_t begin, size_t end, unsigned) {
            for (size_t i = begin; i < end; ++i) leaves_[i] = leaf_primitive(input.primitives, wide.refs[i]);
        });
        view_ = {nodes_.data(), leaves_.data(), tree.root, u32(nodes_.size()), wide.depth};
    }
    StructureStats stats() const override {
        return {nodes_.size(), leaves_.size(), nodes_.bytes() + leaves_.bytes(), view_.depth};
    }
    std::vector<StructureArray> arrays() const override {
        return {{"nodes", offsetof(Cwbvh, nodes), nodes_.data(), nodes_.bytes()},
                {"leaves", offsetof(Cwbvh, leaves), leaves_.data(), leaves_.bytes()}};
    }

 private:
    HugeArray<CwbvhNode> nodes_;
    HugeArray<LeafPrimitive> leaves_;
};

}  // namespace

CwbvhNodes build_cwbvh_nodes(const Tree2& tree, const Collapse::Costs& costs, ThreadPool& pool) {
    Collapse collapse(tree, costs, pool);
    CwbvhNodes out;
    out.nodes.resize(1);
    std::vector<Open> later;
    make_nodes(tree, collapse, {{0, 0, 0}}, &later, &out);
    std::vector<CwbvhNodes> parts(later.size());
    pool.parallel_for(later.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            parts[i].nodes.resize(1);
            make_nodes(tree, collapse, {{later[i].from, 0, later[i].level}}, nullptr, &parts[i]);
        }
    });
    size_t nodes = out.nodes.size(), refs = out.refs.size();
    for (const CwbvhNodes& part : parts) {
        nodes += part.nodes.size() - 1;
        refs += part.refs.size();
    }
    out.nodes.reserve(nodes);
    out.refs.reserve(refs);
    for (size_t i = 0; i < parts.size(); ++i) append(parts[i], later[i].to, &out);
    if (out.depth > CWBVH_MAX_DEPTH) throw std::length_error("The wide tree is too deep.");
    return out;
}

std::unique_ptr<Structure> build_cwbvh(const StructureInput& input, ThreadPool& pool) {
    return std::make_unique<CompressedTree>(input, pool);
}

}  // namespace luch::cpu

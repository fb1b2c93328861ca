// The builder of best trees: beside sorting refs to two sides, a set may be cut by a plane, and a triangle that the
// plane cuts goes to both sides with the box of its part there (Stich, Friedrich, Dietrich 2009, "Spatial Splits in
// Bounding Volume Hierarchies"; its unsplitting too).
#include <algorithm>

#include "cpu/accel/slices.h"
#include "cpu/accel/split.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 4096;            // refs a thread takes at once
constexpr u32 TASK_REFS = 8192;        // smaller sets are built by one thread each
constexpr float LEAST_SHARE = 0.05f;    // of the set's area: of the overlap, likewise
constexpr float LEAST_OVERLAP = 1e-5f;  // of the root's area: of the best sorted halves, for a cut to be tried

using Boxes = std::vector<PrimBox>;

struct Task {
    Boxes refs;
    u64 extra;
    u32 level;
};

class Builder {
 public:
    Builder(const Primitives& all, u32 max_leaf, ThreadPool& pool) : clipper_(all), max_leaf_(max_leaf), pool_(pool) {}
    void set_root_area(float area) { root_area_ = area; }
    std::vector<Task> tasks;
    std::vector<Subtree> subtrees;

    // extra: refs that may be added below. out: the top, with tasks for others, or one such task's subtree.
    void grow(Subtree& out, u32 at, Boxes refs, u64 extra, u32 level, bool top) {
        out.depth = std::max(out.depth, level);
        if (top && refs.size() <= TASK_REFS) {
            tasks.push_back({std::move(refs), extra, level});
            subtrees.push_back({at, {}, {}});
            return;
        }
        PrimSet set = bound_all(refs.data(), refs.size(), pool_);
        Bvh2Node& node = out.nodes[at];
        for (int axis = 0; axis < 3; ++axis) {
            node.lo[axis] = -set.box.v[axis];
            node.hi[axis] = set.box.v[axis + 4];
        }
        Boxes left, right;
        if (!divide(set, refs, extra, level >= HALVING_LEVEL, top, &left, &right)) {
            node.child = u32(out.refs.size());
            node.count = u32(refs.size());
            for (const PrimBox& ref : refs) out.refs.push_back(ref.id);
            return;
        }
        u64 both = left.size() + right.size(), rest = extra - (both - std::min<u64>(both, refs.size()));
        u64 left_extra = rest * left.size() / both;
        u32 pair = u32(out.nodes.size());
        node.child = pair;
        node.count = 0;
        out.nodes.resize(pair + 2);
        Boxes().swap(refs);
        grow(out, pair, std::move(left), left_extra, level + 1, top);
        grow(out, pair + 1, std::move(right), rest - left_extra, level + 1, top);
    }

 private:
    // False: the set stays a leaf.
    bool divide(const PrimSet& set, Boxes& refs, u64 extra, bool deep, bool top, Boxes* left, Boxes* right) {
        u32 count = set.count();
        bool small = count <= max_leaf_;
        if (count == 1 || (small && deep)) return false;
        Boxes scratch(count);
        Splitter splitter(refs.data(), scratch.data(), 1, pool_);
        Split split = splitter.find(set, deep, top);
        float sorted = INFINITE_DISTANCE;
        Cut cut;
        if (!split.halve) {
            sorted = split.left.half_area() * float(split.left_count) +
                     split.right.half_area() * float(count - split.left_count);
            f8 overlap = min_of(split.left.get(), split.right.get());
            if (extra > 0 && !is_empty(overlap) &&
                half_area(overlap) > max_f(LEAST_OVERLAP * root_area_, LEAST_SHARE * set.half_area()))
                cut = find_cut(set, refs);
        }
        float area = set.half_area(), cheapest = min_f(cut.cost, sorted);
        if (small && !(cheapest + area < area * float(count))) return false;
        if (cut.cost < sorted && apply_cut(set, cut, refs, extra, left, right)) return true;
        left->clear();
        right->clear();
        PrimSet l, r;
        splitter.apply(set, split, &l, &r, top);
        const PrimBox* sides = splitter.prims(l);
        left->assign(sides + l.begin, sides + l.end);
        right->assign(sides + r.begin, sides + r.end);
        return true;
    }

    Cut find_cut(const PrimSet& set, const Boxes& refs) const {
        Slicing slicing(set, clipper_);
        std::vector<Slices> chunks((refs.size() + CHUNK - 1) / CHUNK);
        pool_.parallel_for(refs.size(), CHUNK, [&](size_t begin, size_t end, unsigned) {
            for (size_t i = begin; i < end; ++i) slicing.add(refs[i], &chunks[begin / CHUNK]);
        });
        for (size_t c = 1; c < chunks.size(); ++c) chunks[0].merge(chunks[c]);
        return choose_cut(chunks[0], slicing);
    }

    // False: too many refs would be added, or a side would be no smaller.
    bool apply_cut(const PrimSet& set, const Cut& cut, const Boxes& refs, u64 extra, Boxes* left, Boxes* right) const {
        Slicing slicing(set, clipper_);
        std::vector<Boxes> sides(2 * ((refs.size() + CHUNK - 1) / CHUNK));
        pool_.parallel_for(refs.size(), CHUNK, [&](size_t begin, size_t end, unsigned) {
            Boxes *l = &sides[begin / CHUNK * 2], *r = l + 1;
            for (size_t i = begin; i < end; ++i) place(refs[i], cut, slicing, l, r);
        });
        for (size_t s = 0; s < sides.size(); ++s) {
            Boxes* to = s % 2 == 0 ? left : right;
            to->insert(to->end(), sides[s].begin(), sides[s].end());
        }
        size_t both = left->size() + right->size();
        return both <= refs.size() + extra && std::max(left->size(), right->size()) < refs.size() && !left->empty() &&
               !right->empty();
    }

    static void place(const PrimBox& ref, const Cut& cut, const Slicing& slicing, Boxes* left, Boxes* right) {
        int axis = cut.axis;
        if (slicing.slice_of(axis, ref.hi[axis]) < cut.bin) return left->push_back(ref);
        if (slicing.slice_of(axis, -ref.minus_lo[axis]) >= cut.bin) return right->push_back(ref);
        f8 box = load_box(ref);
        f8 parts[2];
        slicing.cut(ref, axis, cut.bin, parts);
        float area_left = half_area(cut.left), area_right = half_area(cut.right);
        float n_left = float(cut.left_count), n_right = float(cut.right_count);
        float whole_left = half_area(united(cut.left, box)) * n_left + area_right * (n_right - 1.0f);
        float whole_right = area_left * (n_left - 1.0f) + half_area(united(cut.right, box)) * n_right;
        if (min_f(whole_left, whole_right) < cut.cost) return (whole_left < whole_right ? left : right)->push_back(ref);
        if (!is_empty(parts[0])) left->push_back(clipped(ref, parts[0]));
        if (!is_empty(parts[1])) right->push_back(clipped(ref, parts[1]));
    }
    static PrimBox clipped(const PrimBox& ref, f8 box) {
        PrimBox out;
        store(&out, box);
        out.id = ref.id;
        out.unused = 0;
        return out;
    }

    Clipper clipper_;
    u32 max_leaf_;
    ThreadPool& pool_;
    float root_area_ = 0.0f;
};

}  // namespace

Tree2 build_tree2_spatial(const StructureInput& input, const HugeArray<PrimBox>& boxes, u32 max_leaf,
                          ThreadPool& pool) {
    Builder builder(input.primitives, max_leaf, pool);
    Subtree top = {0, std::vector<Bvh2Node>(2), {}};
    PrimSet all = bound_all(boxes.data(), boxes.size(), pool);
    builder.set_root_area(all.half_area());
    u64 extra = u64(MAX_REPEATED * float(boxes.size()));
    builder.grow(top, 0, Boxes(boxes.data(), boxes.data() + boxes.size()), extra, 0, true);
    std::vector<Task>& tasks = builder.tasks;
    std::vector<Subtree>& subtrees = builder.subtrees;
    pool.parallel_for(tasks.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            subtrees[i].nodes.resize(1);
            builder.grow(subtrees[i], 0, std::move(tasks[i].refs), tasks[i].extra, tasks[i].level, false);
        }
    });
    Tree2 tree;
    tree.nodes = std::move(top.nodes);
    append_subtrees(tree, subtrees, pool);
    return tree;
}

}  // namespace luch::cpu

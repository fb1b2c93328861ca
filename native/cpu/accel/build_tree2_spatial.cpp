// The builder of best trees: beside sorting refs to two sides, a set may be cut by a plane, and a triangle that the
// plane cuts goes to both sides with the box of its part there (Stich, Friedrich, Dietrich 2009, "Spatial Splits in
// Bounding Volume Hierarchies"; its unsplitting too).
//
// Clipped boxes stay conservative (math/bounds.h, 1): a ray passes the accepted point P of a triangle at no more than
// half of 7 EPS (t |d_z| + extent) from each plane, and P, an exact mean of the corners, lies in the part on one side.
// So the exact part's box, widened like the whole triangle's by its whole extent, holds what the cone must find, and
// so does its intersection with the box before the cut. The cut's own rounding widens it a little more.
#include <algorithm>

#include "cpu/accel/split.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 4096;            // refs a thread takes at once
constexpr u32 TASK_REFS = 8192;        // smaller sets are built by one thread each
constexpr int BINS = 16;                // fewer for small sets: slices_for
constexpr float LEAST_SHARE = 0.05f;    // of the set's area: of the overlap, likewise
constexpr float LEAST_OVERLAP = 1e-5f;  // of the root's area: of the best sorted halves, for a cut to be tried

using Boxes = std::vector<PrimBox>;

f8 load_box(const PrimBox& p) { return load<f8>(&p); }
f8 nothing() { return f8{} - INFINITE_DISTANCE; }
float half_area(f8 box) {
    float x = box[0] + box[4], y = box[1] + box[5], z = box[2] + box[6];
    return x * y + y * z + z * x;
}
bool is_empty(f8 box) { return !(box[0] + box[4] >= 0.0f && box[1] + box[5] >= 0.0f && box[2] + box[6] >= 0.0f); }
f8 united(f8 a, f8 b) { return max_of(a, b); }

class Clipper {
 public:
    explicit Clipper(const Primitives& all) : all_(all) {}

    // Cuts the ref's primitive at ascending planes: out[0] is the part below the first, out[count] that above the last,
    // each widened and within the box before.
    void cut(const PrimBox& ref, int axis, const float* planes, int count, f8* out) const {
        std::fill_n(out, count + 1, nothing());
        float error;
        if (ref.id < all_.triangle_count) {
            const float* p = all_.corners + 9 * u64(ref.id);
            f8 corners[3] = {point(p), point(p + 3), point(p + 6)};
            for (int k = 0; k < 3; ++k) add_edge(corners[k], corners[(k + 1) % 3], axis, planes, count, out);
            f8 whole = united(united(corners[0], corners[1]), corners[2]);
            error = CUT_ERROR * max_f(whole[0] + whole[4], max_f(whole[1] + whole[5], whole[2] + whole[6]));
        } else {
            const float* s = all_.spheres + 4 * u64(ref.id - all_.triangle_count);
            f8 whole = united(point(s) + s[3], point(s) - s[3]);
            for (int i = 0; i <= count; ++i) {
                out[i] = whole;
                if (i > 0) out[i][axis] = min_f(whole[axis], -planes[i - 1]);
                if (i < count) out[i][axis + 4] = min_f(whole[axis + 4], planes[i]);
            }
            error = CUT_ERROR * s[3];
        }
        f8 before = load_box(ref);
        for (int i = 0; i <= count; ++i) {
            f8 sign = out[i] < 0.0f ? splat<f8>(-2.0f * EPS) : splat<f8>(2.0f * EPS);
            f8 part = min_of(out[i] + out[i] * sign + (error + 1e-44f), before);
            out[i] = is_empty(part) ? nothing() : part;
        }
    }

 private:
    // Of a point on an edge, found in single precision: a weight of three roundings, a product, a sum.
    static constexpr float CUT_ERROR = SHEAR_ERROR + 6.0f * EPS;

    static f8 point(const float* p) { return f8{-p[0], -p[1], -p[2], 0.0f, p[0], p[1], p[2], 0.0f}; }
    static void add_edge(f8 a, f8 b, int axis, const float* planes, int count, f8* out) {
        if (a[axis + 4] > b[axis + 4]) std::swap(a, b);
        float from = a[axis + 4], to = b[axis + 4];
        int part = 0;
        while (part < count && from >= planes[part]) ++part;
        out[part] = united(out[part], a);
        for (; part < count && to >= planes[part]; ++part) {
            f8 crossing = a + (b - a) * ((planes[part] - from) / (to - from));
            if (!(to > from)) crossing = b;
            out[part] = united(out[part], crossing);
            out[part + 1] = united(out[part + 1], crossing);
        }
        out[part] = united(out[part], b);
    }
    const Primitives& all_;
};

struct Cut {
    float cost = INFINITE_DISTANCE;
    int axis = 0, bin = 0;  // first bin of the right side
    f8 left = nothing(), right = nothing();
    u32 left_count = 0, right_count = 0;
};

// Equal slices of a set's box along each axis.
struct Slices {
    f8 box[3][BINS];
    u32 begin[3][BINS] = {}, end[3][BINS] = {};  // refs whose first or last slice it is
    Slices() { std::fill_n(&box[0][0], 3 * BINS, nothing()); }
    void merge(const Slices& o) {
        for (int axis = 0; axis < 3; ++axis)
            for (int b = 0; b < BINS; ++b) {
                box[axis][b] = united(box[axis][b], o.box[axis][b]);
                begin[axis][b] += o.begin[axis][b];
                end[axis][b] += o.end[axis][b];
            }
    }
};

class Slicing {
 public:
    Slicing(const PrimSet& set, const Clipper& clipper) : clipper_(clipper), slices_(slices_for(set.count())) {
        const Corners& box = set.box;
        for (int axis = 0; axis < 3; ++axis) {
            float extent = box.extent(axis);
            usable_[axis] = extent > 1e-30f && extent < 1e37f;
            inverse_step_[axis] = float(slices_) / extent;
            for (int s = 0; s < slices_; ++s) planes_[axis][s] = -box.v[axis] + extent / float(slices_) * float(s);
        }
    }
    bool usable(int axis) const { return usable_[axis]; }
    // Refs that end where a slice begins count for it.
    int slice_of(int axis, float x) const {
        const float* planes = planes_[axis];
        int slice = int(clamp_f((x - planes[0]) * inverse_step_[axis], 0.0f, float(slices_ - 1)));
        while (slice > 0 && x < planes[slice]) --slice;
        while (slice + 1 < slices_ && x >= planes[slice + 1]) ++slice;
        return slice;
    }
    void add(const PrimBox& ref, Slices* out) const {
        for (int axis = 0; axis < 3; ++axis) {
            if (!usable_[axis]) continue;
            int first = slice_of(axis, -ref.minus_lo[axis]), last = slice_of(axis, ref.hi[axis]);
            ++out->begin[axis][first];
            ++out->end[axis][last];
            f8 parts[BINS] = {load_box(ref)};
            if (first < last) clipper_.cut(ref, axis, planes_[axis] + first + 1, last - first, parts);
            for (int s = first; s <= last; ++s) out->box[axis][s] = united(out->box[axis][s], parts[s - first]);
        }
    }
    // The ref's parts below and above a slice's lower plane.
    void cut(const PrimBox& ref, int axis, int slice, f8* parts) const {
        clipper_.cut(ref, axis, planes_[axis] + slice, 1, parts);
    }

 private:
    static int slices_for(u32 refs) { return refs <= 16 ? 4 : refs <= 64 ? 8 : BINS; }

    const Clipper& clipper_;
    int slices_;
    float planes_[3][BINS];  // the slices' lower planes
    float inverse_step_[3];
    bool usable_[3];
};

Cut choose_cut(const Slices& slices, const Slicing& slicing) {
    Cut best;
    for (int axis = 0; axis < 3; ++axis) {
        if (!slicing.usable(axis)) continue;
        f8 right[BINS + 1];
        u32 right_count[BINS + 1] = {};
        right[BINS] = nothing();
        for (int b = BINS - 1; b > 0; --b) {
            right[b] = united(right[b + 1], slices.box[axis][b]);
            right_count[b] = right_count[b + 1] + slices.end[axis][b];
        }
        f8 left = nothing();
        u32 left_count = 0;
        for (int b = 1; b < BINS; ++b) {
            left = united(left, slices.box[axis][b - 1]);
            left_count += slices.begin[axis][b - 1];
            if (left_count == 0 || right_count[b] == 0) continue;
            float cost = half_area(left) * float(left_count) + half_area(right[b]) * float(right_count[b]);
            if (cost < best.cost) best = {cost, axis, b, left, right[b], left_count, right_count[b]};
        }
    }
    return best;
}

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
    PrimSet all = bound_all(boxes.data(), input.count, pool);
    builder.set_root_area(all.half_area());
    u64 extra = u64(MAX_REPEATED * float(input.count));
    builder.grow(top, 0, Boxes(boxes.data(), boxes.data() + input.count), extra, 0, true);
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

// Builds kd-trees from the top (Wald, Havran 2006, without their sorted events: bins for large cells, counting for
// small ones, O(N log N) both). Large cells are cut one after another by all threads, the rest are subtrees of one
// thread each. Nothing depends on the number of threads.
#include <cmath>
#include <stdexcept>

#include "cpu/accel/bvh8.h"
#include "cpu/accel/kd_clip.h"
#include "cpu/accel/kd_split.h"
#include "cpu/accel/slivers.h"
#include "cpu/accel/structure.h"
#include "luch/accel/kd_tree.h"

namespace luch::cpu {
namespace {

constexpr size_t SUBTREE_REFS = 8192;  // cells of fewer refs are one thread's work
constexpr size_t CHUNK_REFS = 4096;
// Slivers that cross a cell side by side cross both of its halves alike: only quarters hold fewer of them.
constexpr float SLIVER_PATIENCE = 1.2f;

// A cell that is to be cut.
struct Cell {
    Box box;
    u32 depth;
    u64 spare;  // refs that its subtree may have beyond those that it has now
};

void divide(const Cell& cell, size_t count, KdPlane cut, size_t below_count, size_t above_count, Cell* below,
            Cell* above) {
    Halves halves = cut_box(cell.box, cut.axis, cut.plane);
    u64 both = below_count + above_count, had = cell.spare + count;
    u64 spare = had > both ? had - both : 0;
    u64 share = both ? u64(double(spare) * (double(below_count) / double(both))) : 0;
    *below = {halves.below, cell.depth + 1, share};
    *above = {halves.above, cell.depth + 1, spare - share};
}

class Builder {
 public:
    Builder(const StructureInput& input, ThreadPool& pool)
        : all_(input.primitives), settings_(kd_settings(input.quality)), pool_(pool) {}
    void build(const StructureInput& input);

    HugeArray<KdNode> nodes;
    HugeArray<u32> refs;
    Box root;
    u32 depth = 0;

 private:
    // A subtree with its own numbering from 0.
    struct Subtree {
        std::vector<KdNode> nodes;
        std::vector<u32> refs;
        u32 depth = 0;
        std::vector<KdRef> arena;  // the refs of the cells from its root to the current one, each behind its parent's
    };
    // Of the part above the subtrees, in order of creation.
    struct TopNode {
        KdPlane cut;
        u32 below, above;  // indices of top nodes
        u32 subtree;  // NONE: an inner node
    };
    struct Open {
        Cell cell;
        std::vector<KdRef> refs;
        u32 node;
    };

    KdPlane choose(const Cell& cell, const KdRef* refs, size_t count) const;
    KdPlane choose_parallel(const Cell& cell, const std::vector<KdRef>& refs) const;
    template <class Below, class Above>
    void distribute(const KdRef* refs, size_t count, KdPlane cut, Below&& below, Above&& above) const;
    void cut_parallel(Open& from, KdPlane cut, Open* below, Open* above) const;
    void build_top(std::vector<KdRef> all_refs, double references);
    void build_subtree(Subtree& tree, const Cell& cell, size_t begin, size_t end) const;
    void join();

    const Primitives& all_;
    KdSettings settings_;
    float patience_ = 1.0f;  // KdBins::choose
    ThreadPool& pool_;
    std::vector<TopNode> top_;
    std::vector<Open> open_;  // the subtrees' cells
    std::vector<Subtree> subtrees_;  // of open_, in its order
};

KdPlane Builder::choose(const Cell& cell, const KdRef* refs, size_t count) const {
    if (cell.depth >= KD_MAX_DEPTH || count <= 1) return {-1, 0.0f};
    if (count < settings_.exact_below) return choose_exact_plane(refs, u32(count), cell.box, cell.spare);
    KdBins bins(cell.box);
    bins.add(refs, count);
    return bins.choose(u32(count), cell.spare, patience_);
}

KdPlane Builder::choose_parallel(const Cell& cell, const std::vector<KdRef>& refs) const {
    if (cell.depth >= KD_MAX_DEPTH) return {-1, 0.0f};
    std::vector<KdBins> parts((refs.size() + CHUNK_REFS - 1) / CHUNK_REFS, KdBins(cell.box));
    pool_.parallel_for(refs.size(), CHUNK_REFS, [&](size_t begin, size_t end, unsigned) {
        parts[begin / CHUNK_REFS].add(refs.data() + begin, end - begin);
    });
    for (size_t i = 1; i < parts.size(); ++i) parts[0].add(parts[i]);
    return parts[0].choose(u32(refs.size()), cell.spare, patience_);
}

// Calls below(ref) and above(ref) for what is on either side.
template <class Below, class Above>
void Builder::distribute(const KdRef* refs, size_t count, KdPlane cut, Below&& below, Above&& above) const {
    for (size_t i = 0; i < count; ++i) {
        const KdRef r = refs[i];
        bool is_under = is_below(r, cut.axis, cut.plane), is_over = is_above(r, cut.axis, cut.plane);
        if (!(is_under && is_over)) {
            if (is_under) below(r);
            if (is_over) above(r);
            continue;
        }
        Halves halves = settings_.clips ? cut_primitive(all_, r.ref, r.box(), cut.axis, cut.plane)
                                        : cut_box(r.box(), cut.axis, cut.plane);
        if (!is_empty(halves.below)) below(KdRef{halves.below.lo, r.ref, halves.below.hi, 0});
        if (!is_empty(halves.above)) above(KdRef{halves.above.lo, r.ref, halves.above.hi, 0});
    }
}

void Builder::cut_parallel(Open& from, KdPlane cut, Open* below, Open* above) const {
    size_t chunks = (from.refs.size() + CHUNK_REFS - 1) / CHUNK_REFS;
    std::vector<std::vector<KdRef>> under(chunks), over(chunks);
    pool_.parallel_for(from.refs.size(), CHUNK_REFS, [&](size_t begin, size_t end, unsigned) {
        std::vector<KdRef>&u = under[begin / CHUNK_REFS], &o = over[begin / CHUNK_REFS];
        distribute(
            from.refs.data() + begin, end - begin, cut, [&](const KdRef& r) { u.push_back(r); },
            [&](const KdRef& r) { o.push_back(r); });
    });
    size_t count = from.refs.size();
    from.refs = {};
    for (size_t i = 0; i < chunks; ++i) {
        below->refs.insert(below->refs.end(), under[i].begin(), under[i].end());
        above->refs.insert(above->refs.end(), over[i].begin(), over[i].end());
    }
    divide(from.cell, count, cut, below->refs.size(), above->refs.size(), &below->cell, &above->cell);
}

// references: for each primitive, as many as slivers of a mesh are worth.
void Builder::build_top(std::vector<KdRef> all_refs, double references) {
    u64 spare = u64((references - 1.0) * double(all_refs.size())) + 64;
    std::vector<Open> waiting;
    waiting.push_back({{root, 0, spare}, std::move(all_refs), 0});
    top_.push_back({});
    while (!waiting.empty()) {
        Open next = std::move(waiting.back());
        waiting.pop_back();
        KdPlane cut = next.refs.size() > SUBTREE_REFS ? choose_parallel(next.cell, next.refs) : KdPlane{-1, 0.0f};
        u32 node = next.node;
        if (cut.axis < 0) {
            top_[node] = {cut, NONE, NONE, u32(open_.size())};
            open_.push_back(std::move(next));
            continue;
        }
        Open below, above;
        cut_parallel(next, cut, &below, &above);
        below.node = u32(top_.size());
        above.node = below.node + 1;
        top_[node] = {cut, below.node, above.node, NONE};
        top_.resize(top_.size() + 2);
        waiting.push_back(std::move(above));
        waiting.push_back(std::move(below));
    }
}

// Recursion is no deeper than KD_MAX_DEPTH.
void Builder::build_subtree(Subtree& tree, const Cell& cell, size_t begin, size_t end) const {
    pool_.check_cancelled();
    u32 node = u32(tree.nodes.size());
    tree.nodes.push_back({});
    KdPlane cut = choose(cell, tree.arena.data() + begin, end - begin);
    if (cut.axis < 0) {
        tree.nodes[node] = {u32(tree.refs.size()) << 2 | KD_LEAF, u32(end - begin)};
        for (size_t i = begin; i < end; ++i) tree.refs.push_back(tree.arena[i].ref);
        tree.depth = cell.depth > tree.depth ? cell.depth : tree.depth;
        return;
    }
    // Room for both sides: above's in front, below's behind it, so that below can go first and be dropped.
    size_t count = end - begin, above_end = end, below_begin = end + count, below_end = below_begin;
    if (tree.arena.size() < end + 2 * count) tree.arena.resize(end + 4 * count);
    KdRef* arena = tree.arena.data();
    distribute(
        arena + begin, count, cut, [&](const KdRef& r) { arena[below_end++] = r; },
        [&](const KdRef& r) { arena[above_end++] = r; });
    Cell below, above;
    divide(cell, count, cut, below_end - below_begin, above_end - end, &below, &above);
    build_subtree(tree, below, below_begin, below_end);
    if (tree.nodes.size() > KD_MAX_LINK || tree.refs.size() > KD_MAX_LINK)
        throw std::length_error("This kd-tree has more than 2^30 nodes or references.");
    tree.nodes[node] = {u32(tree.nodes.size()) << 2 | u32(cut.axis), float_bits(cut.plane)};
    build_subtree(tree, above, end, above_end);
}

// All parts in depth-first order.
void Builder::join() {
    size_t node_count = 0, ref_count = 0;
    for (const TopNode& t : top_) node_count += t.subtree == NONE ? 1 : subtrees_[t.subtree].nodes.size();
    for (const Subtree& s : subtrees_) ref_count += s.refs.size();
    if (node_count > KD_MAX_LINK || ref_count > KD_MAX_LINK)
        throw std::length_error("This kd-tree has more than 2^30 nodes or references.");
    nodes = HugeArray<KdNode>(node_count);
    refs = HugeArray<u32>(ref_count);
    u32 node_at = 0, ref_at = 0;
    std::vector<std::pair<u32, u32>> waiting = {{0, NONE}};  // a top node, and the node that it is above the plane of
    while (!waiting.empty()) {
        auto [index, parent] = waiting.back();
        waiting.pop_back();
        const TopNode& t = top_[index];
        if (parent != NONE) nodes[parent].link |= node_at << 2;
        if (t.subtree == NONE) {
            waiting.push_back({t.above, node_at});
            waiting.push_back({t.below, NONE});
            nodes[node_at++] = {u32(t.cut.axis), float_bits(t.cut.plane)};
            continue;
        }
        const Subtree& s = subtrees_[t.subtree];
        depth = s.depth > depth ? s.depth : depth;
        u32 first = node_at;
        for (KdNode n : s.nodes) {
            n.link += ((n.link & 3u) == KD_LEAF ? ref_at : first) << 2;
            nodes[node_at++] = n;
        }
        for (u32 ref : s.refs) refs[ref_at++] = ref;
    }
}

void Builder::build(const StructureInput& input) {
    std::vector<KdRef> list(input.count);
    root = empty_box();
    for (u32 i = 0; i < input.count; ++i) {
        Box box = primitive_box(all_, input.refs[i]);
        list[i] = {box.lo, input.refs[i], box.hi, 0};
        extend(root, box);
    }
    if (input.count == 0) root = {make_vec3(0.0f), make_vec3(0.0f)};
    double pieces = sliver_pieces(input, pool_);
    if (pieces > 1.0) patience_ = SLIVER_PATIENCE;
    build_top(std::move(list), double(settings_.references) * pieces);
    subtrees_.resize(open_.size());
    pool_.parallel_for(open_.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            Subtree& tree = subtrees_[i];
            tree.arena = std::move(open_[i].refs);
            build_subtree(tree, open_[i].cell, 0, tree.arena.size());
            tree.arena = {};
        }
    });
    join();
}

class KdTreeStructure final : public StructureOf<KdTree> {
 public:
    KdTreeStructure(const StructureInput& input, ThreadPool& pool) : StructureOf(input.primitives) {
        Builder builder(input, pool);
        builder.build(input);
        nodes_ = std::move(builder.nodes);
        refs_ = std::move(builder.refs);
        depth_ = builder.depth;
        view_ = {nodes_.data(), refs_.data(), builder.root};
    }
    StructureStats stats() const override {
        return {nodes_.size(), refs_.size(), nodes_.bytes() + refs_.bytes(), depth_};
    }
    std::vector<StructureArray> arrays() const override {
        return {{"nodes", offsetof(KdTree, nodes), nodes_.data(), nodes_.bytes()},
                {"refs", offsetof(KdTree, refs), refs_.data(), refs_.bytes()}};
    }

 private:
    HugeArray<KdNode> nodes_;
    HugeArray<u32> refs_;
    u32 depth_ = 0;
};

}  // namespace

std::unique_ptr<Structure> build_kd_tree(const StructureInput& input, ThreadPool& pool) {
    return std::make_unique<KdTreeStructure>(input, pool);
}

}  // namespace luch::cpu

// The fast builder: primitives sorted along a Morton curve, neighbours merged bottom up while many merge at once
// (Meister, Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction"); what is
// left then is few, and binned surface area makes the top of it, where quality counts most.
#include <algorithm>

#include "cpu/accel/split.h"
#include "cpu/accel/tree2.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 16384;       // clusters a thread takes at once
constexpr int RADIUS = 8;          // neighbours looked at on either side
constexpr u32 MAX_HEIGHT = 32;     // levels of a cluster; with the top's 32 + 31 within BVH2_MAX_DEPTH
constexpr u32 SHRINK = 8;          // the top takes over when so many primitives make a cluster,
constexpr u32 FEW = 256;           // or this few clusters are left,
constexpr u32 SLOW = 20;           // or fewer than one in so many merges
constexpr u32 TOP_HALVING_LEVEL = HALVING_LEVEL - MAX_HEIGHT;

// A cluster is a PrimBox: id is its ref's place or its pair of nodes, unused says which and how high it is.
bool is_leaf(const PrimBox& c) { return c.unused == 0; }
u32 height(const PrimBox& c) { return c.unused; }
f8 box_of(const PrimBox& c) { return load<f8>(&c); }

float merged_area(f8 a, f8 b) {
    f8 m = max_of(a, b);
    float x = m[0] + m[4], y = m[1] + m[5], z = m[2] + m[6];
    return x * y + y * z + z * x;
}

struct Keyed {
    u64 key;
    u32 index;
};

u64 spread_bits(u64 x) {  // 16 bits, two zeros after each
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
}

std::vector<Keyed> morton_keys(const PrimBox* boxes, size_t count, ThreadPool& pool) {
    PrimSet all = bound_all(boxes, count, pool);
    float low[3], scale[3];
    for (int axis = 0; axis < 3; ++axis) {
        float extent = all.centroids.extent(axis);
        low[axis] = -all.centroids.v[axis];
        scale[axis] = extent > 1e-36f && extent < 1e38f ? 65535.0f / extent : 0.0f;
    }
    std::vector<Keyed> keys(count);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            u64 key = 0;
            for (int axis = 0; axis < 3; ++axis) {
                float place = ((boxes[i].hi[axis] - boxes[i].minus_lo[axis]) - low[axis]) * scale[axis];
                key |= spread_bits(u64(clamp_f(place, 0.0f, 65535.0f))) << axis;
            }
            keys[i] = {key, u32(i)};
        }
    });
    return keys;
}

// Least significant digits first, 48 bits, stable.
void sort_keys(std::vector<Keyed>& keys, ThreadPool& pool) {
    constexpr u32 BITS = 12, DIGITS = 1u << BITS;
    constexpr size_t SORT_CHUNK = 65536;
    std::vector<Keyed> other(keys.size());
    size_t chunks = (keys.size() + SORT_CHUNK - 1) / SORT_CHUNK;
    std::vector<u32> first(chunks * DIGITS);
    for (u32 shift = 0; shift < 48; shift += BITS) {
        auto digit = [shift](const Keyed& k) { return u32(k.key >> shift) & (DIGITS - 1); };
        std::fill(first.begin(), first.end(), 0u);
        pool.parallel_for(keys.size(), SORT_CHUNK, [&](size_t begin, size_t end, unsigned) {
            u32* counts = &first[begin / SORT_CHUNK * DIGITS];
            for (size_t i = begin; i < end; ++i) ++counts[digit(keys[i])];
        });
        u32 next = 0;
        for (u32 d = 0; d < DIGITS; ++d)
            for (size_t c = 0; c < chunks; ++c) {
                u32 here = first[c * DIGITS + d];
                first[c * DIGITS + d] = next;
                next += here;
            }
        pool.parallel_for(keys.size(), SORT_CHUNK, [&](size_t begin, size_t end, unsigned) {
            u32* to = &first[begin / SORT_CHUNK * DIGITS];
            for (size_t i = begin; i < end; ++i) other[to[digit(keys[i])]++] = keys[i];
        });
        keys.swap(other);
    }
}

class Clusters {
 public:
    // scratch: as large, its contents do not matter.
    Clusters(HugeArray<PrimBox> sorted, HugeArray<PrimBox> scratch, size_t count, ThreadPool& pool)
        : now_(std::move(sorted)),
          next_(std::move(scratch)),
          nodes_(2 * count + 2),
          nearest_(count),
          count_(count),
          pool_(pool) {}

    void merge_all() {
        size_t enough = std::max<size_t>(count_ / SHRINK, FEW);
        while (count_ > enough) {
            find_nearest();
            size_t before = count_;
            merge();
            if ((before - count_) * SLOW < before) break;
        }
    }
    size_t count() const { return count_; }
    const PrimBox& operator[](size_t i) const { return now_[i]; }
    // The pairs of what has merged, from place 2; with room for the top's nodes behind them.
    std::vector<Bvh2Node> take_nodes() {
        nodes_.resize(node_count_);
        return std::move(nodes_);
    }

 private:
    // Of equal areas the pair of least i ^ j: the same order from both sides, and identical boxes pair up at once.
    void find_nearest() {
        pool_.parallel_for(count_, CHUNK, [&](size_t begin, size_t end, unsigned) {
            for (size_t i = begin; i < end; ++i) {
                nearest_[i] = NONE;
                if (height(now_[i]) >= MAX_HEIGHT) continue;
                f8 box = box_of(now_[i]);
                float best = INFINITE_DISTANCE;
                size_t last = std::min(i + RADIUS, count_ - 1);
                for (size_t j = i < RADIUS ? 0 : i - RADIUS; j <= last; ++j) {
                    if (j == i || height(now_[j]) >= MAX_HEIGHT) continue;
                    float area = merged_area(box, box_of(now_[j]));
                    if (area < best || (area == best && nearest_[i] != NONE && (i ^ j) < (i ^ nearest_[i]))) {
                        best = area;
                        nearest_[i] = u32(j);
                    }
                }
            }
        });
    }
    bool mutual(size_t i) const { return nearest_[i] != NONE && nearest_[nearest_[i]] == i; }

    void merge() {
        size_t chunks = (count_ + CHUNK - 1) / CHUNK;
        std::vector<size_t> first(chunks + 1), first_pair(chunks + 1);
        pool_.parallel_for(count_, CHUNK, [&](size_t begin, size_t end, unsigned) {
            size_t kept = 0, merged = 0;
            for (size_t i = begin; i < end; ++i) {
                bool pair = mutual(i);
                kept += !pair || nearest_[i] > i;
                merged += pair && nearest_[i] > i;
            }
            first[begin / CHUNK + 1] = kept;
            first_pair[begin / CHUNK + 1] = merged;
        });
        for (size_t c = 0; c < chunks; ++c) {
            first[c + 1] += first[c];
            first_pair[c + 1] += first_pair[c];
        }
        pool_.parallel_for(count_, CHUNK, [&](size_t begin, size_t end, unsigned) {
            size_t to = first[begin / CHUNK], pair = node_count_ + 2 * first_pair[begin / CHUNK];
            for (size_t i = begin; i < end; ++i) {
                if (!mutual(i)) {
                    next_[to++] = now_[i];
                } else if (nearest_[i] > i) {
                    next_[to++] = join(now_[i], now_[nearest_[i]], pair);
                    pair += 2;
                }
            }
        });
        node_count_ += 2 * first_pair[chunks];
        count_ = first[chunks];
        std::swap(now_, next_);
    }

    PrimBox join(const PrimBox& a, const PrimBox& b, size_t pair) {
        nodes_[pair] = node_of(a);
        nodes_[pair + 1] = node_of(b);
        PrimBox out;
        store(&out, max_of(box_of(a), box_of(b)));
        out.id = u32(pair);
        out.unused = std::max(height(a), height(b)) + 1;
        return out;
    }
    static Bvh2Node node_of(const PrimBox& c) {
        return {{-c.minus_lo[0], -c.minus_lo[1], -c.minus_lo[2]}, c.id, {c.hi[0], c.hi[1], c.hi[2]}, is_leaf(c)};
    }

    HugeArray<PrimBox> now_, next_;
    std::vector<Bvh2Node> nodes_;
    size_t node_count_ = 2;
    std::vector<u32> nearest_;
    size_t count_;
    ThreadPool& pool_;
};

// The top's leaves become the clusters they stand for; its nodes follow theirs, but for the root.
Tree2 attach(const Tree2& top, Clusters& clusters, std::vector<u32> refs) {
    struct Open {
        u32 node, to, level;
    };
    Tree2 tree;
    tree.nodes = clusters.take_nodes();
    tree.refs = std::move(refs);
    tree.root = top.root;
    u32 offset = u32(tree.nodes.size()) - 2;
    tree.nodes.resize(offset + top.nodes.size());
    std::vector<Open> open = {{0, 0, 0}};
    while (!open.empty()) {
        auto [at, to, level] = open.back();
        open.pop_back();
        Bvh2Node node = top.nodes[at];
        if (node.count == 0) {
            open.push_back({node.child + 1, node.child + 1 + offset, level + 1});
            open.push_back({node.child, node.child + offset, level + 1});
            node.child += offset;
        } else {
            const PrimBox& c = clusters[top.refs[node.child]];
            tree.depth = std::max(tree.depth, level + height(c));
            node.count = is_leaf(c);
            node.child = c.id;
        }
        tree.nodes[to] = node;
    }
    return tree;
}

}  // namespace

Tree2 build_tree2_clusters(HugeArray<PrimBox> boxes, size_t count, ThreadPool& pool) {
    std::vector<Keyed> keys = morton_keys(boxes.data(), count, pool);
    sort_keys(keys, pool);
    HugeArray<PrimBox> sorted(count);
    std::vector<u32> refs(count);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            sorted[i] = boxes[keys[i].index];
            refs[i] = sorted[i].id;
            sorted[i].id = u32(i);
            sorted[i].unused = 0;
        }
    });
    keys = {};
    Clusters clusters(std::move(sorted), std::move(boxes), count, pool);
    clusters.merge_all();
    HugeArray<PrimBox> top(clusters.count());
    for (size_t i = 0; i < clusters.count(); ++i) {
        top[i] = clusters[i];
        top[i].id = u32(i);
    }
    Tree2 tree = build_tree2_binned(std::move(top), clusters.count(), 1, TOP_HALVING_LEVEL, pool);
    return attach(tree, clusters, std::move(refs));
}

}  // namespace luch::cpu

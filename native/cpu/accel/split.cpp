#include "cpu/accel/split.h"

#include <algorithm>

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 16384;           // primitives a thread takes at once
constexpr float TRAVERSAL_COST = 1.0f;  // a node's visit, in tests of one block

f8 load_box(const PrimBox& prim) { return load<f8>(&prim); }

// (-2 c, 2 c) of the box's centre c; lanes 3 and 7 are junk.
f8 centroid_corners(f8 box) {
    f8 swapped = __builtin_shufflevector(box, box, 4, 5, 6, 7, 0, 1, 2, 3);
    return box - swapped;
}

f8 nothing() { return f8{} - INFINITE_DISTANCE; }

}  // namespace

struct Splitter::BinOf {
    f8 low, scale;  // lanes 4..6 count

    explicit BinOf(const Corners& centroids) {
        for (int axis = 0; axis < 3; ++axis) {
            float extent = centroids.extent(axis);
            // A flat, overflowing or denormal axis puts everything into bin 0: no cut there.
            bool usable = extent > 1e-36f && extent < 1e38f;
            low[axis + 4] = -centroids.v[axis];
            scale[axis + 4] = usable ? float(BINS) * BIN_SHARE / extent : 0.0f;
            low[axis] = scale[axis] = 0.0f;
        }
        low[3] = low[7] = 1.0f;  // ids are tiny floats: keep slow denormal products away
        scale[3] = scale[7] = 0.0f;
    }
    i8v operator()(f8 box) const {
        f8 place = (centroid_corners(box) - low) * scale;
        i8v bin = __builtin_convertvector(place, i8v);
        i8v last = i8v{} + (BINS - 1);
        bin = bin < last ? bin : last;
        return bin > 0 ? bin : i8v{};
    }
};

PrimSet bound_all(const PrimBox* prims, size_t count, ThreadPool& pool) {
    std::vector<PrimSet> chunks((count + CHUNK - 1) / CHUNK);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        f8 box = nothing(), centroids = nothing();
        for (size_t i = begin; i < end; ++i) {
            f8 b = load_box(prims[i]);
            box = max_of(box, b);
            centroids = max_of(centroids, centroid_corners(b));
        }
        chunks[begin / CHUNK].box.set(box);
        chunks[begin / CHUNK].centroids.set(centroids);
    });
    PrimSet all;
    all.end = static_cast<u32>(count);
    for (const PrimSet& chunk : chunks) {
        all.box.merge(chunk.box);
        all.centroids.merge(chunk.centroids);
    }
    return all;
}

void Splitter::fill(Bins& bins, const PrimBox* prims, u32 begin, u32 end, const BinOf& bin_of) {
    for (u32 i = begin; i < end; ++i) {
        f8 box = load_box(prims[i]);
        i8v bin = bin_of(box);
        for (int axis = 0; axis < 3; ++axis) {
            int b = bin[axis + 4];
            Corners& corners = bins.box[axis][b];
            corners.set(max_of(corners.get(), box));
            ++bins.count[axis][b];
        }
    }
}

Split Splitter::find(const PrimSet& set, bool halve, bool parallel) {
    pool_.check_cancelled();
    Split split;
    split.halve = true;
    if (halve) return split;
    BinOf bin_of(set.centroids);
    const PrimBox* prims = buffers_[set.buffer];
    if (!parallel || set.count() <= CHUNK) {
        Bins bins;
        fill(bins, prims, set.begin, set.end, bin_of);
        return choose(set, bins);
    }
    chunk_bins_.assign((set.count() + CHUNK - 1) / CHUNK, Bins());
    pool_.parallel_for(set.count(), CHUNK, [&](size_t begin, size_t end, unsigned) {
        fill(chunk_bins_[begin / CHUNK], prims, set.begin + u32(begin), set.begin + u32(end), bin_of);
    });
    Bins all;
    for (const Bins& chunk : chunk_bins_)
        for (int axis = 0; axis < 3; ++axis)
            for (int b = 0; b < BINS; ++b) {
                all.box[axis][b].merge(chunk.box[axis][b]);
                all.count[axis][b] += chunk.count[axis][b];
            }
    return choose(set, all);
}

Split Splitter::choose(const PrimSet& set, const Bins& bins) const {
    Split best;
    float best_cost = INFINITE_DISTANCE;
    for (int axis = 0; axis < 3; ++axis) {
        float right_cost[BINS];
        Corners corners;
        u32 count = 0;
        for (int b = BINS - 1; b > 0; --b) {
            corners.merge(bins.box[axis][b]);
            count += bins.count[axis][b];
            right_cost[b] = count ? corners.half_area() * float(blocks(count)) : 0.0f;
        }
        corners = Corners();
        count = 0;
        for (int b = 1; b < BINS; ++b) {
            corners.merge(bins.box[axis][b - 1]);
            count += bins.count[axis][b - 1];
            if (count == 0 || count == set.count()) continue;
            float cost = corners.half_area() * float(blocks(count)) + right_cost[b];
            if (cost < best_cost) {  // NaN: not this one
                best_cost = cost;
                best.axis = axis;
                best.bin = b;
                best.left_count = count;
            }
        }
    }
    float area = set.half_area();
    bool may_stay = set.count() <= LEAF_MAX_ITEMS * leaf_width_;
    bool no_cut = !(best_cost < INFINITE_DISTANCE);
    best.leaf = may_stay && !(best_cost + TRAVERSAL_COST * area < area * float(blocks(set.count())));
    best.halve = no_cut;
    for (int b = 0; b < BINS && !no_cut; ++b) (b < best.bin ? best.left : best.right).merge(bins.box[best.axis][b]);
    return best;
}

void Splitter::apply(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right, bool parallel) {
    if (split.halve) return halve(set, left, right);
    u32 middle = set.begin + split.left_count;
    left->begin = set.begin;
    left->end = right->begin = middle;
    right->end = set.end;
    left->buffer = right->buffer = set.buffer ^ 1u;
    left->box = split.left;
    right->box = split.right;
    if (parallel && set.count() > CHUNK)
        partition_parallel(set, split, left, right);
    else
        partition(set, split, left, right);
}

void Splitter::halve(const PrimSet& set, PrimSet* left, PrimSet* right) {
    PrimBox* prims = buffers_[set.buffer];
    int axis = 0;
    for (int a = 1; a < 3; ++a)
        if (set.centroids.extent(a) > set.centroids.extent(axis)) axis = a;
    auto centre = [axis](const PrimBox& p) { return p.hi[axis] - p.minus_lo[axis]; };
    u32 middle = set.begin + set.count() / 2;
    std::nth_element(prims + set.begin, prims + middle, prims + set.end, [&](const PrimBox& a, const PrimBox& b) {
        return centre(a) != centre(b) ? centre(a) < centre(b) : a.id < b.id;
    });
    u32 cuts[3] = {set.begin, middle, set.end};
    PrimSet* halves[2] = {left, right};
    for (int side = 0; side < 2; ++side) {
        PrimSet half;
        half.begin = cuts[side];
        half.end = cuts[side + 1];
        half.buffer = set.buffer;
        f8 box = nothing(), centroids = nothing();
        for (u32 i = half.begin; i < half.end; ++i) {
            box = max_of(box, load_box(prims[i]));
            centroids = max_of(centroids, centroid_corners(load_box(prims[i])));
        }
        half.box.set(box);
        half.centroids.set(centroids);
        *halves[side] = half;
    }
}

void Splitter::partition(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right) {
    const PrimBox* from = buffers_[set.buffer];
    PrimBox* to = buffers_[set.buffer ^ 1u];
    BinOf bin_of(set.centroids);
    f8 left_centroids = nothing(), right_centroids = nothing();
    size_t l = set.begin, r = set.end - 1;
    // No branch on the side: it would be mispredicted every other time. Both ends are written, one advances.
    for (u32 i = set.begin; i < set.end; ++i) {
        f8 box = load_box(from[i]);
        int is_left = bin_of(box)[split.axis + 4] < split.bin;
        store(&to[l], box);
        store(&to[r], box);
        l += size_t(is_left);
        r -= size_t(1 - is_left);
        i8v mask = i8v{} - is_left;
        f8 centroid = centroid_corners(box);
        left_centroids = max_of(left_centroids, mask ? centroid : nothing());
        right_centroids = max_of(right_centroids, mask ? nothing() : centroid);
    }
    left->centroids.set(left_centroids);
    right->centroids.set(right_centroids);
}

void Splitter::partition_parallel(const PrimSet& set, const Split& split, PrimSet* left, PrimSet* right) {
    const PrimBox* from = buffers_[set.buffer];
    PrimBox* to = buffers_[set.buffer ^ 1u];
    BinOf bin_of(set.centroids);
    size_t chunks = chunk_bins_.size();
    std::vector<u32> first_left(chunks + 1), first_right(chunks + 1);
    first_left[0] = left->begin;
    first_right[0] = right->begin;
    for (size_t c = 0; c < chunks; ++c) {
        u32 in_left = 0, size = std::min(CHUNK, set.count() - u32(c) * CHUNK);
        for (int b = 0; b < split.bin; ++b) in_left += chunk_bins_[c].count[split.axis][b];
        first_left[c + 1] = first_left[c] + in_left;
        first_right[c + 1] = first_right[c] + size - in_left;
    }
    std::vector<Corners> centroids(2 * chunks);
    pool_.parallel_for(set.count(), CHUNK, [&](size_t begin, size_t end, unsigned) {
        size_t c = begin / CHUNK;
        u32 next[2] = {first_right[c], first_left[c]};
        f8 bounds[2] = {nothing(), nothing()};
        for (size_t i = set.begin + begin; i < set.begin + end; ++i) {
            f8 box = load_box(from[i]);
            int is_left = bin_of(box)[split.axis + 4] < split.bin;
            store(&to[next[is_left]++], box);
            bounds[is_left] = max_of(bounds[is_left], centroid_corners(box));
        }
        centroids[2 * c].set(bounds[1]);
        centroids[2 * c + 1].set(bounds[0]);
    });
    for (size_t c = 0; c < chunks; ++c) {
        left->centroids.merge(centroids[2 * c]);
        right->centroids.merge(centroids[2 * c + 1]);
    }
}

}  // namespace luch::cpu

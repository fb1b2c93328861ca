#include "cpu/accel/slivers.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cpu/accel/slices.h"

namespace luch::cpu {
namespace {

constexpr size_t CHUNK = 16384;  // boxes a thread takes at once
constexpr double MOST_PIECES = 8.0;
static_assert(MOST_PIECES <= MAX_SLICES);
// Pieces beside the first ones, of all slivers of a mesh: about 60 bytes each in a tree of eight-wide nodes.
constexpr double MOST_ADDED = double(1u << 22);
// Of what a triangle itself covers: boxes up to so large are no waste. Half of its box is what a right-angled one along
// the axes fills.
constexpr double FILLED = 4.0;

double extent(const PrimBox& b, int axis) { return double(b.minus_lo[axis]) + double(b.hi[axis]); }
double area(double x, double y, double z) { return x * y + y * z + z * x; }
double area_of(const PrimBox& b) { return area(extent(b, 0), extent(b, 1), extent(b, 2)); }

double area_of_all(const PrimBox* boxes, size_t count, ThreadPool& pool) {
    PrimSet all = bound_all(boxes, count, pool);
    const float* v = all.box.v;
    return area(double(v[0]) + double(v[4]), double(v[1]) + double(v[5]), double(v[2]) + double(v[6]));
}

// Of the box, what is in vain.
double waste(const Primitives& all, const PrimBox& box) {
    if (box.id >= all.triangle_count) return 0.0;
    const float* p = all.corners + 9 * u64(box.id);
    double a[3], b[3];
    for (int k = 0; k < 3; ++k) {
        a[k] = double(p[3 + k]) - double(p[k]);
        b[k] = double(p[6 + k]) - double(p[k]);
    }
    double covered = 0.0;
    for (int k = 0; k < 3; ++k) {
        int x = (k + 1) % 3, y = (k + 2) % 3;
        covered += 0.5 * std::abs(a[x] * b[y] - a[y] * b[x]);
    }
    return std::max(0.0, area_of(box) - FILLED * covered);
}

template <class Of>
double sum_of(size_t count, ThreadPool& pool, const Of& of) {
    std::vector<double> parts((count + CHUNK - 1) / CHUNK);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        double sum = 0.0;
        for (size_t i = begin; i < end; ++i) sum += of(i);
        parts[begin / CHUNK] = sum;
    });
    double sum = 0.0;
    for (double part : parts) sum += part;
    return sum;
}

// k pieces waste a k-th: of all ways to share the pieces out, as the root of the waste leaves the least.
struct Shares {
    const Primitives& all;
    double of_root = 0.0;  // pieces for a root of the waste of 1; 0: nothing is cut

    u32 pieces(const PrimBox& box) const {
        return u32(std::clamp(of_root * std::sqrt(waste(all, box)), 1.0, MOST_PIECES));
    }
};

double mean_pieces(double needless, double slivers) {
    return std::min({needless / MANY_BOXES, MOST_PIECES, 1.0 + MOST_ADDED / slivers});
}

}  // namespace

double boxes_met(const PrimBox* boxes, size_t count, ThreadPool& pool) {
    double all = area_of_all(boxes, count, pool);
    return all > 0.0 ? sum_of(count, pool, [&](size_t i) { return area_of(boxes[i]); }) / all : 0.0;
}

double sliver_pieces(const Primitives& all, const PrimBox* boxes, size_t count, ThreadPool& pool) {
    if (boxes_met(boxes, count, pool) < MANY_BOXES) return 1.0;
    double needless = sum_of(count, pool, [&](size_t i) { return waste(all, boxes[i]); });
    double slivers = sum_of(count, pool, [&](size_t i) { return waste(all, boxes[i]) > 0.0 ? 1.0 : 0.0; });
    return std::max(1.0, mean_pieces(needless / area_of_all(boxes, count, pool), std::max(slivers, 1.0)));
}

double sliver_pieces(const StructureInput& input, ThreadPool& pool) {
    if (input.count == 0) return 1.0;
    HugeArray<PrimBox> boxes = boxes_of(input, pool);
    return sliver_pieces(input.primitives, boxes.data(), boxes.size(), pool);
}

HugeArray<PrimBox> boxes_of(const StructureInput& input, ThreadPool& pool) {
    HugeArray<PrimBox> boxes(input.count);
    pool.parallel_for(input.count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            Box b = primitive_box(input.primitives, input.refs[i]);
            boxes[i] = {{-b.lo.x, -b.lo.y, -b.lo.z}, input.refs[i], {b.hi.x, b.hi.y, b.hi.z}, 0};
        }
    });
    return boxes;
}

HugeArray<PrimBox> cut_slivers(const Primitives& all, HugeArray<PrimBox> boxes, size_t* count, ThreadPool& pool) {
    double mean = sliver_pieces(all, boxes.data(), *count, pool);
    if (mean <= 1.0) return boxes;
    double roots = sum_of(*count, pool, [&](size_t i) { return std::sqrt(waste(all, boxes[i])); });
    double slivers = sum_of(*count, pool, [&](size_t i) { return waste(all, boxes[i]) > 0.0 ? 1.0 : 0.0; });
    Shares shares = {all, mean * slivers / roots};
    Clipper clipper(all);
    std::vector<std::vector<PrimBox>> made((*count + CHUNK - 1) / CHUNK);
    pool.parallel_for(*count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            const PrimBox& whole = boxes[i];
            u32 pieces = shares.pieces(whole);
            if (pieces == 1) {
                made[begin / CHUNK].push_back(whole);
                continue;
            }
            int axis = 0;
            for (int k = 1; k < 3; ++k)
                if (extent(whole, k) > extent(whole, axis)) axis = k;
            float planes[MAX_SLICES];
            for (u32 k = 1; k < pieces; ++k)
                planes[k - 1] = float(extent(whole, axis) * k / pieces - double(whole.minus_lo[axis]));
            f8 parts[MAX_SLICES];
            clipper.cut(whole, axis, planes, int(pieces) - 1, parts);
            for (u32 k = 0; k < pieces; ++k) {
                if (is_empty(parts[k])) continue;
                PrimBox piece;
                store(&piece, parts[k]);
                piece.id = whole.id;
                piece.unused = 0;
                made[begin / CHUNK].push_back(piece);
            }
        }
    });
    std::vector<size_t> first(made.size() + 1, 0);
    for (size_t c = 0; c < made.size(); ++c) first[c + 1] = first[c] + made[c].size();
    *count = first.back();
    HugeArray<PrimBox> out(*count);
    pool.parallel_for(made.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t c = begin; c < end; ++c) std::copy(made[c].begin(), made[c].end(), out.data() + first[c]);
    });
    return out;
}

}  // namespace luch::cpu

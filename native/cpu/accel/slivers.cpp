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

// Of some boxes: their area, what of it is in vain, and how many have such a part.
struct Waste {
    double area = 0.0, needless = 0.0, roots = 0.0, slivers = 0.0;
};

template <class Add>
Waste sum_of(size_t count, ThreadPool& pool, const Add& add) {
    std::vector<Waste> parts((count + CHUNK - 1) / CHUNK);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) add(i, parts[begin / CHUNK]);
    });
    Waste sum;
    for (const Waste& part : parts) {
        sum.area += part.area;
        sum.needless += part.needless;
        sum.roots += part.roots;
        sum.slivers += part.slivers;
    }
    return sum;
}

double boxes_met(const PrimBox* boxes, size_t count, double root_area, ThreadPool& pool) {
    if (!(root_area > 0.0)) return 0.0;
    return sum_of(count, pool, [&](size_t i, Waste& sum) { sum.area += area_of(boxes[i]); }).area / root_area;
}

// How a mesh's slivers are cut: pieces on the mean over those that gain, and those of one for a root of its waste of 1. k
// pieces waste a k-th: of all ways to share the pieces out, as the root of the waste leaves the least.
struct Cutting {
    double pieces = 1.0, of_root = 0.0;
};

Cutting cutting_of(const Primitives& all, const PrimBox* boxes, size_t count, ThreadPool& pool) {
    const double root_area = area_of_all(boxes, count, pool);
    if (boxes_met(boxes, count, root_area, pool) < MANY_BOXES) return {};
    Waste sum = sum_of(count, pool, [&](size_t i, Waste& part) {
        double needless = waste(all, boxes[i]);
        part.needless += needless;
        part.roots += std::sqrt(needless);
        part.slivers += needless > 0.0 ? 1.0 : 0.0;
    });
    double worth = sum.needless / root_area / MANY_BOXES;
    if (worth <= 1.0) return {};
    double pieces = std::min({worth, MOST_PIECES, 1.0 + MOST_ADDED / sum.slivers});
    return {pieces, pieces * sum.slivers / sum.roots};
}

}  // namespace

double boxes_met(const PrimBox* boxes, size_t count, ThreadPool& pool) {
    return boxes_met(boxes, count, area_of_all(boxes, count, pool), pool);
}

double sliver_pieces(const StructureInput& input, ThreadPool& pool) {
    if (input.count == 0) return 1.0;
    HugeArray<PrimBox> boxes = boxes_of(input, pool);
    return cutting_of(input.primitives, boxes.data(), boxes.size(), pool).pieces;
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
    const Cutting cutting = cutting_of(all, boxes.data(), *count, pool);
    if (cutting.pieces <= 1.0) return boxes;
    Clipper clipper(all);
    std::vector<std::vector<PrimBox>> made((*count + CHUNK - 1) / CHUNK);
    pool.parallel_for(*count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) {
            const PrimBox& whole = boxes[i];
            u32 pieces = u32(std::clamp(cutting.of_root * std::sqrt(waste(all, whole)), 1.0, MOST_PIECES));
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

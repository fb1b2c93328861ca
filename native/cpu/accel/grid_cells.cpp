#include "cpu/accel/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

constexpr u32 CHUNK = 4096;        // primitives
constexpr u32 BUCKET_BITS = 8;     // the highest bits of a cell's number

// A primitive in units of cells from the grid's corner. A cell is a cube of half side `half`: widened by the grid's
// margin, and by the primitive's own (math/bounds.h, 1: SHEAR_ERROR times its extent).
class CellTest {
 public:
    CellTest(const Primitives& all, u32 ref, const GridShape& grid);
    // Calls emit(cell) for each cell that the primitive touches; some that it misses narrowly may be among them.
    template <class Emit>
    void each(Emit&& emit) const;
    // About as many, without looking: those along its longest line and those of its area.
    double estimate() const {
        double x = span(0), y = span(1), z = span(2), all = x * y * z;
        if (!separates_) return all;
        double area = 0.5 * (std::abs(normal_[0]) + std::abs(normal_[1]) + std::abs(normal_[2]));
        return std::min(all, x + y + z + area);
    }

 private:
    struct Edge {
        double a, b, c;  // the triangle's projection can meet the cell only if a x + b y + c >= 0 for its centre
    };
    u32 span(int axis) const { return last_[axis] - first_[axis] + 1; }
    void set_triangle(const float* corners, const GridShape& grid);
    void set_edges(int k, const double (&v)[3][3], double slack);

    u32 first_[3], last_[3], mask_[3];
    bool separates_ = false;  // the tests below say more than the box
    double half_[3], normal_[3], offset_, radius_;
    Edge edges_[3][3];  // of the projections along x, y, z
};

CellTest::CellTest(const Primitives& all, u32 ref, const GridShape& grid) {
    Box box = primitive_box(all, ref);
    int wide = 0;
    for (int k = 0; k < 3; ++k) {
        double lo = double(grid.lo[k]), width = double(grid.width[k]), most = double(grid.size[k] - 1);
        double margin = double(GRID_MARGIN) + GRID_CELL_ERROR;
        auto index = [&](double x) { return u32(x > 0 ? std::min(x, most) : 0.0); };  // NaN: 0
        first_[k] = index((double(box.lo[k]) - lo) / width - margin);
        last_[k] = index((double(box.hi[k]) - lo) / width + margin);
        mask_[k] = grid.mask[k];
        wide += first_[k] < last_[k];
    }
    // In a row of cells the box is right: the triangle is in one piece.
    if (wide >= 2 && ref < all.triangle_count) set_triangle(all.corners + 9 * u64(ref), grid);
}

void CellTest::set_triangle(const float* corners, const GridShape& grid) {
    double v[3][3], extent = 0, widest = 0;
    for (int k = 0; k < 3; ++k) {
        double lo = double(grid.lo[k]), width = double(grid.width[k]);
        for (int i = 0; i < 3; ++i) v[i][k] = (double(corners[3 * i + k]) - lo) / width;
        float low = std::min({corners[k], corners[3 + k], corners[6 + k]});
        float high = std::max({corners[k], corners[3 + k], corners[6 + k]});
        extent = std::max(extent, double(high) - double(low));
        widest = std::max(widest, (double(high) - double(low)) / width + 1);
    }
    for (int k = 0; k < 3; ++k)
        half_[k] = 0.5 + double(GRID_MARGIN) + GRID_CELL_ERROR +
                   (double(SHEAR_ERROR) * extent + double(DENORMAL_MARGIN)) / double(grid.width[k]);
    double e[2][3];
    for (int k = 0; k < 3; ++k) {
        e[0][k] = v[1][k] - v[0][k];
        e[1][k] = v[2][k] - v[0][k];
    }
    normal_[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
    normal_[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
    normal_[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    // What rounding leaves of a triangle without area must exclude nothing.
    double slack = GRID_FLAT_ERROR * widest * widest;
    offset_ = -(normal_[0] * v[0][0] + normal_[1] * v[0][1] + normal_[2] * v[0][2]);
    radius_ = half_[0] * std::abs(normal_[0]) + half_[1] * std::abs(normal_[1]) + half_[2] * std::abs(normal_[2]) +
              slack * (widest + double(std::max({grid.size[0], grid.size[1], grid.size[2]})));
    for (int k = 0; k < 3; ++k) set_edges(k, v, slack);
    separates_ = true;
}

// The edges of the projection along axis k (Schwarz, Seidel 2010).
void CellTest::set_edges(int k, const double (&v)[3][3], double slack) {
    int x = k == 0 ? 1 : 0, y = k == 2 ? 1 : 2;
    double turn = k == 1 ? -normal_[k] : normal_[k];
    for (int i = 0; i < 3; ++i) {
        const double *p = v[i], *q = v[i == 2 ? 0 : i + 1];
        double sign = turn > 0 ? 1 : -1, a = -sign * (q[y] - p[y]), b = sign * (q[x] - p[x]);
        double c = half_[x] * std::abs(a) + half_[y] * std::abs(b) - (a * p[x] + b * p[y]) + 1e4 * slack;
        edges_[k][i] = std::abs(turn) > 1e4 * slack ? Edge{a, b, c} : Edge{0, 0, 1};
    }
}

template <class Emit>
void CellTest::each(Emit&& emit) const {
    auto inside = [&](int k, double x, double y) {
        bool in = true;
        for (const Edge& e : edges_[k]) in &= e.a * x + e.b * y + e.c >= 0;
        return in;
    };
    for (u32 z = first_[2]; z <= last_[2]; ++z)
        for (u32 y = first_[1]; y <= last_[1]; ++y) {
            double cy = double(y) + 0.5, cz = double(z) + 0.5;
            if (separates_ && !inside(0, cy, cz)) continue;
            u32 row = spread_bits(y, mask_[1]) | spread_bits(z, mask_[2]), code = spread_bits(first_[0], mask_[0]);
            double height = normal_[1] * cy + normal_[2] * cz + offset_;
            for (u32 x = first_[0]; x <= last_[0]; ++x, code = (code - mask_[0]) & mask_[0]) {
                double cx = double(x) + 0.5;
                bool touches = !separates_ || (std::abs(normal_[0] * cx + height) <= radius_ && inside(1, cx, cz) &&
                                               inside(2, cx, cy));
                if (touches) emit(row | code);
            }
        }
}

struct Listed {
    u32 cell, ref;
};

// A chunk of primitives, listed by the buckets of their cells.
struct ChunkLists {
    std::vector<Listed> entries;
    std::vector<u32> first;  // of each bucket, and the end
};

void list_chunk(const Primitives& all, const u32* refs, u32 count, const GridShape& shape, u32 shift, u32 buckets,
                ChunkLists* out) {
    std::vector<Listed> found;
    found.reserve(4 * size_t(count));
    out->first.assign(buckets + 1, 0);
    for (u32 i = 0; i < count; ++i)
        CellTest(all, refs[i], shape).each([&](u32 cell) {
            found.push_back({cell, refs[i]});
            ++out->first[(cell >> shift) + 1];
        });
    for (u32 b = 0; b < buckets; ++b) out->first[b + 1] += out->first[b];
    if (buckets == 1) {
        out->entries = std::move(found);
        return;
    }
    std::vector<u32> at(out->first.begin(), out->first.end() - 1);
    out->entries.resize(found.size());
    for (const Listed& l : found) out->entries[at[l.cell >> shift]++] = l;
}

}  // namespace

Box box_of_primitives(const Primitives& all, const u32* refs, u32 count) {
    if (count == 0) return {make_vec3(0.0f), make_vec3(0.0f)};
    Box box = empty_box();
    for (u32 i = 0; i < count; ++i) extend(box, primitive_box(all, refs[i]));
    return box;
}

GridShape shape_grid(const Box& box, u32 bits) {
    GridShape out;
    out.lo = box.lo;
    out.hi = box.hi;
    float narrowest = INFINITE_DISTANCE;
    double width[3];
    for (int k = 0; k < 3; ++k) {
        width[k] = double(box.hi[k]) - double(box.lo[k]);
        out.size[k] = 1;
        out.mask[k] = 0;
    }
    for (u32 bit = 0; bit < bits; ++bit) {  // halves the widest: lower bits of a cell's number are finer steps
        int k = width[0] >= width[1] ? (width[0] >= width[2] ? 0 : 2) : (width[1] >= width[2] ? 1 : 2);
        width[k] *= 0.5;
        out.size[k] *= 2;
        out.mask[k] |= 1u << (bits - 1 - bit);
    }
    for (int k = 0; k < 3; ++k) {
        out.width[k] = above(float(width[k]));
        out.inverse[k] = 1.0f / out.width[k];
        if (out.size[k] > 1) narrowest = min_f(narrowest, out.width[k]);
    }
    out.reach = narrowest * (GRID_MARGIN / (GRID_DOUBT * EPS));
    if (narrowest < 1e-30f) out.reach = -1.0f;
    return out;
}

u32 choose_grid_bits(const Primitives& all, const u32* refs, u32 count, const Box& box, float density, u64 most_refs,
                     ThreadPool& pool) {
    double cells = std::max(double(density) * double(count), 1.0);
    u32 bits = std::min(u32(std::lround(std::log2(cells))), GRID_MAX_BITS);
    std::vector<double> parts((size_t(count) + CHUNK - 1) / CHUNK);
    for (; bits > 0; --bits) {
        GridShape shape = shape_grid(box, bits);
        pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
            double sum = 0;
            for (size_t i = begin; i < end; ++i) sum += CellTest(all, refs[i], shape).estimate();
            parts[begin / CHUNK] = sum;
        });
        double sum = 0;
        for (double part : parts) sum += part;
        if (sum <= double(most_refs)) break;
    }
    return bits;
}

GridCells fill_grid(const Primitives& all, const u32* refs, u32 count, const Box& box, u32 bits, ThreadPool& pool) {
    GridCells out;
    out.shape = shape_grid(box, bits);
    u32 chunks = (count + CHUNK - 1) / CHUNK;
    u32 shift = chunks > 1 && bits > BUCKET_BITS ? bits - BUCKET_BITS : bits, buckets = 1u << (bits - shift);
    std::vector<ChunkLists> lists(chunks);
    pool.parallel_for(count, CHUNK, [&](size_t begin, size_t end, unsigned) {
        list_chunk(all, refs + begin, u32(end - begin), out.shape, shift, buckets, &lists[begin / CHUNK]);
    });
    std::vector<u64> start(buckets + 1, 0);
    for (u32 b = 0; b < buckets; ++b) {
        start[b + 1] = start[b];
        for (const ChunkLists& l : lists) start[b + 1] += l.first[b + 1] - l.first[b];
    }
    if (start[buckets] > 0xffffffffu) throw std::length_error("This grid has more than 2^32 references.");
    out.first.resize((size_t(1) << bits) + 1);
    out.refs.resize(start[buckets]);
    pool.parallel_for(buckets, 1, [&](size_t begin, size_t end, unsigned) {
        std::vector<u32> at(size_t(1) << shift);
        for (size_t b = begin; b < end; ++b) {
            auto each = [&](auto&& body) {
                for (const ChunkLists& l : lists)
                    for (u32 i = l.first[b]; i < l.first[b + 1]; ++i) body(l.entries[i]);
            };
            u32 base = u32(b << shift), next = u32(start[b]);
            std::fill(at.begin(), at.end(), 0u);
            each([&](const Listed& l) { ++at[l.cell - base]; });
            for (size_t c = 0; c < at.size(); ++c) {
                out.first[base + c] = next;
                next += at[c];
                at[c] = out.first[base + c];
            }
            each([&](const Listed& l) { out.refs[at[l.cell - base]++] = l.ref; });
        }
    });
    out.first.back() = u32(start[buckets]);
    return out;
}

}  // namespace luch::cpu

// Builds level by level: the cells of a level that hold many primitives become grids of the next. A budget of refs is
// shared among them by their primitives, so memory is bounded whatever the scene.
#include <algorithm>
#include <cmath>
#include <optional>

#include "cpu/accel/grid_cells.h"
#include "cpu/accel/slivers.h"
#include "cpu/accel/structure.h"
#include "luch/accel/hierarchical_grid.h"

namespace luch::cpu {
namespace {

constexpr float OUTER_CELLS_PER_PRIMITIVE = 0.12f, INNER_CELLS_PER_PRIMITIVE = 1.5f;
constexpr u32 DENSE = 12;              // a cell of more primitives is divided
constexpr u32 LARGE = 1u << 15;       // a cell of more is divided by all threads together
// A grid is worth its place if its cells hold fewer than this part of its primitives, on average: of a short list the
// cells that hold any, of a long one all, as a teapot may fill one cell alone and be divided there.
constexpr double WORTHWHILE = 0.45;
constexpr u32 LONG_LIST = 64;
// Exponent of the pieces that slivers are worth in a tree, for refs: one takes 4 bytes, a place in a tree 40.
constexpr double SLIVER_REFS = 1.3;

// A cell to be divided: its number in the built cells, what it is, and its primitives.
struct DenseCell {
    u32 cell;
    Box box;
    std::vector<u32> refs;
};

// What of a primitive's box any walk looks for in the cell: the cell widened by the margin; border cells are endless.
Box cell_box(const GridShape& grid, u32 code) {
    float lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
        u32 i = 0, bit = 0;
        for (u32 mask = grid.mask[k]; mask != 0; mask &= mask - 1, ++bit) i |= ((code >> lowest_bit(mask)) & 1u) << bit;
        double width = double(grid.width[k]), margin = 1.01 * double(GRID_MARGIN), from = double(grid.lo[k]);
        lo[k] = i == 0 ? grid.lo[k] : below(float(from + width * (double(i) - margin)));
        hi[k] = i + 1 == grid.size[k] ? grid.hi[k] : above(float(from + width * (double(i) + 1 + margin)));
    }
    return {vec3_of(lo), vec3_of(hi)};
}

// What stands in the middle of a scene would stand at the corner of eight cells, and with their margins in all eight.
Box off_centre(Box box, u32 bits) {
    GridShape even = shape_grid(box, bits);
    Vec3 shift = {even.width[0], even.width[1], even.width[2]};
    box.hi += 0.3f * shift;
    return box;
}

class HierarchicalGridStructure final : public StructureOf<HierarchicalGrid> {
 public:
    HierarchicalGridStructure(const StructureInput& input, ThreadPool& pool) : StructureOf(input.primitives) {
        Box box = box_of_primitives(primitives_, input.refs, input.count);
        const double pieces = sliver_pieces(input, pool);
        u64 most_refs = u64(double(most_refs_of(input.count)) * std::pow(pieces, SLIVER_REFS));
        u32 bits =
            choose_grid_bits(primitives_, input.refs, input.count, box, OUTER_CELLS_PER_PRIMITIVE, most_refs / 2, pool);
        GridCells outer = fill_grid(primitives_, input.refs, input.count, off_centre(box, bits), bits, pool);
        u64 spare = most_refs - std::min<u64>(outer.refs.size(), most_refs);
        std::vector<DenseCell> dense;
        add_grid(outer, &dense);
        outer = {};
        while (!dense.empty()) spare = divide(&dense, spare, pool);
        view_ = {grids_.data(), cells_.data(), refs_.data()};
    }
    StructureStats stats() const override {
        size_t bytes = grids_.size() * sizeof(CellGrid) + cells_.size() * sizeof(GridCell);
        return {cells_.size(), refs_.size(), bytes + refs_.size() * sizeof(u32), depth_};
    }
    std::vector<StructureArray> arrays() const override {
        return {{"grids", offsetof(HierarchicalGrid, grids), grids_.data(), grids_.size() * sizeof(CellGrid)},
                {"cells", offsetof(HierarchicalGrid, cells), cells_.data(), cells_.size() * sizeof(GridCell)},
                {"refs", offsetof(HierarchicalGrid, refs), refs_.data(), refs_.size() * sizeof(u32)}};
    }

 private:
    void add_grid(const GridCells& grid, std::vector<DenseCell>* dense);
    void add_leaf(u32 cell, const u32* refs, u32 count);
    u64 divide(std::vector<DenseCell>* dense, u64 spare, ThreadPool& pool);
    std::optional<GridCells> make_grid(const DenseCell& cell, u64 most_refs, ThreadPool& pool) const;

    std::vector<CellGrid> grids_;
    std::vector<GridCell> cells_;
    std::vector<u32> refs_;
    u32 depth_ = 0;
};

void HierarchicalGridStructure::add_leaf(u32 cell, const u32* refs, u32 count) {
    cells_[cell] = {u32(refs_.size()), count};
    refs_.insert(refs_.end(), refs, refs + count);
}

void HierarchicalGridStructure::add_grid(const GridCells& grid, std::vector<DenseCell>* dense) {
    u32 base = u32(cells_.size()), count = u32(grid.first.size() - 1);
    grids_.push_back({grid.shape, base});
    cells_.resize(size_t(base) + count);
    for (u32 c = 0; c < count; ++c) {
        const u32 *begin = grid.refs.data() + grid.first[c], *end = grid.refs.data() + grid.first[c + 1];
        if (end - begin <= DENSE)
            add_leaf(base + c, begin, u32(end - begin));
        else
            dense->push_back({base + c, cell_box(grid.shape, c), {begin, end}});
    }
}

std::optional<GridCells> HierarchicalGridStructure::make_grid(const DenseCell& cell, u64 most_refs,
                                                              ThreadPool& pool) const {
    Box box = box_of_primitives(primitives_, cell.refs.data(), u32(cell.refs.size()));
    box = {max_v(box.lo, cell.box.lo), min_v(box.hi, cell.box.hi)};
    u32 count = u32(cell.refs.size());
    u32 bits = choose_grid_bits(primitives_, cell.refs.data(), count, box, INNER_CELLS_PER_PRIMITIVE, most_refs, pool);
    if (bits == 0) return {};
    GridCells grid = fill_grid(primitives_, cell.refs.data(), count, box, bits, pool);
    size_t used = 0;
    for (size_t c = 0; c + 1 < grid.first.size(); ++c) used += grid.first[c + 1] > grid.first[c];
    if (count > LONG_LIST) used = grid.first.size() - 1;
    if (double(grid.refs.size()) > WORTHWHILE * double(count) * double(used)) return {};
    return grid;
}

// Makes grids of the cells, or leaves, and leaves the cells of the next level. Returns what is left of the spare refs.
u64 HierarchicalGridStructure::divide(std::vector<DenseCell>* dense, u64 spare, ThreadPool& pool) {
    std::vector<DenseCell> now = std::move(*dense);
    dense->clear();
    u64 total = 0;
    for (const DenseCell& d : now) total += d.refs.size();
    std::vector<std::optional<GridCells>> made(now.size());
    auto make = [&](size_t i) {
        u64 count = now[i].refs.size();
        made[i] = make_grid(now[i], count + u64(double(spare) * (double(count) / double(total))), pool);
    };
    if (depth_ + 1 < GRID_MAX_LEVELS) {
        for (size_t i = 0; i < now.size(); ++i)
            if (now[i].refs.size() > LARGE) make(i);
        pool.parallel_for(now.size(), 16, [&](size_t begin, size_t end, unsigned) {
            for (size_t i = begin; i < end; ++i)
                if (now[i].refs.size() <= LARGE) make(i);
        });
    }
    size_t grids_before = grids_.size();
    u64 added = 0;
    for (size_t i = 0; i < now.size(); ++i) {
        const std::vector<u32>& refs = now[i].refs;
        if (!made[i]) {
            add_leaf(now[i].cell, refs.data(), u32(refs.size()));
            continue;
        }
        added += made[i]->refs.size() - std::min(refs.size(), made[i]->refs.size());
        cells_[now[i].cell] = {u32(grids_.size()), GRID_CELL_DIVIDED};
        add_grid(*made[i], dense);
        made[i].reset();
    }
    depth_ += grids_.size() > grids_before;
    return spare - std::min(spare, added);
}

}  // namespace

std::unique_ptr<Structure> build_hierarchical_grid(const StructureInput& input, ThreadPool& pool) {
    return std::make_unique<HierarchicalGridStructure>(input, pool);
}

}  // namespace luch::cpu

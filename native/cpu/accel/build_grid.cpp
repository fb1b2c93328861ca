#include "cpu/accel/grid_cells.h"
#include "cpu/accel/structure.h"

namespace luch::cpu {
namespace {

constexpr float CELLS_PER_PRIMITIVE = 5.0f;

class GridStructure final : public StructureOf<Grid> {
 public:
    GridStructure(const StructureInput& input, ThreadPool& pool) : StructureOf(input.primitives) {
        Box box = box_of_primitives(primitives_, input.refs, input.count);
        u64 most_refs = most_refs_of(input.count);
        u32 bits = choose_grid_bits(primitives_, input.refs, input.count, box, CELLS_PER_PRIMITIVE, most_refs, pool);
        cells_ = fill_grid(primitives_, input.refs, input.count, box, bits, pool);
        view_ = {cells_.shape, cells_.first.data(), cells_.refs.data()};
    }
    StructureStats stats() const override {
        return {cells_.first.size() - 1, cells_.refs.size(), (cells_.first.size() + cells_.refs.size()) * sizeof(u32),
                1};
    }
    std::vector<StructureArray> arrays() const override {
        return {{"first", offsetof(Grid, first), cells_.first.data(), cells_.first.size() * sizeof(u32)},
                {"refs", offsetof(Grid, refs), cells_.refs.data(), cells_.refs.size() * sizeof(u32)}};
    }

 private:
    GridCells cells_;
};

}  // namespace

std::unique_ptr<Structure> build_grid(const StructureInput& input, ThreadPool& pool) {
    return std::make_unique<GridStructure>(input, pool);
}

}  // namespace luch::cpu

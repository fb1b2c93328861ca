// Which cells of a grid a primitive touches, and the parallel counting sort that lists them by cell.
#pragma once
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/accel/grid.h"

namespace luch::cpu {

// A grid of 2^bits cells, nearly cubes, over box.
GridShape shape_grid(const Box& box, u32 bits);

// Refs that grids may list: a primitive lies in many cells, and in small grids memory does not matter.
inline constexpr u64 MOST_REFS_PER_PRIMITIVE = 12, REFS_OF_SMALL_GRIDS = 1u << 16;
inline u64 most_refs_of(u32 count) { return MOST_REFS_PER_PRIMITIVE * count + REFS_OF_SMALL_GRIDS; }

// Of the primitives; a point at the origin if there are none.
Box box_of_primitives(const Primitives& all, const u32* refs, u32 count);

// The bits for about `density` cells a primitive, or fewer, so that no more than about most_refs are listed.
u32 choose_grid_bits(const Primitives& all, const u32* refs, u32 count, const Box& box, float density, u64 most_refs,
                     ThreadPool& pool);

struct GridCells {
    GridShape shape;
    std::vector<u32> first;  // one more than cells
    std::vector<u32> refs;   // cell by cell in Z-order, ascending if they were given so
};
GridCells fill_grid(const Primitives& all, const u32* refs, u32 count, const Box& box, u32 bits, ThreadPool& pool);

}  // namespace luch::cpu

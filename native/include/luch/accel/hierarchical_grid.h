// The hierarchical grid: a cell of many primitives holds a grid of its own, over what of them lies in it; for scenes
// of detail at very different scales ("a teapot in a stadium"). No recursion: a walk per level, the outer ones wait.
//
// A grid's walk finds every hit in the cell whose t interval holds the hit's t (grid.h), so the grid in a cell is
// walked in that interval alone; its box holds what any walk of the outer grid looks for in the cell.
#pragma once
#include "luch/accel/grid.h"

namespace luch {

inline constexpr u32 GRID_MAX_LEVELS = 6;

// With GRID_CELL_DIVIDED in count: first is a grid. Else: refs[first] and the count - 1 that follow.
struct GridCell {
    u32 first, count;
};
inline constexpr u32 GRID_CELL_DIVIDED = 0x80000000u;

struct CellGrid {
    GridShape shape;
    u32 first_cell;
};

struct HierarchicalGrid {
    const CellGrid* grids;  // 0: all of space
    const GridCell* cells;
    const u32* refs;
};

// Either walk of one grid.
struct GridWalk {
    u32 grid, first_cell;
    bool is_line;
    float end;
    union {
        GridLine line;
        GridSlabs slabs;
    };

    LUCH_FN bool begin(const HierarchicalGrid& all, u32 index, const GridRay& ray, float t0, float t1) {
        const CellGrid& here = all.grids[index];
        grid = index;
        first_cell = here.first_cell;
        end = t1;
        is_line = grid_line_serves(here.shape, ray);
        if (!is_line) return slabs.begin(here.shape, ray, t0, t1);
        line.begin(here.shape, ray, t0);
        return true;
    }
    LUCH_FN u32 cell() const { return first_cell + (is_line ? line.cell() : slabs.cell()); }
    LUCH_FN float from() const { return is_line ? line.from : slabs.from; }
    LUCH_FN float to() const { return min_f(is_line ? line.to : slabs.to, end); }
    LUCH_FN bool advance(const GridRay& ray, float limit) {
        limit = min_f(limit, end);
        return is_line ? line.advance(limit) : slabs.advance(ray, limit);
    }
};

// Offers the refs of the cells along the ray, near to far, to leaf (cell_refs.h).
template <class Leaf, class Count>
LUCH_FN void walk_hierarchical_grid(const HierarchicalGrid& all, const Ray& ray, Leaf& leaf, Count& count) {
    float t0 = ray.t_min, t1 = leaf.limit();
    Box space = {all.grids[0].shape.lo, all.grids[0].shape.hi};
    BoxRay box = make_box_ray(ray.origin, ray.direction, space);
    GridRay along(ray);
    GridWalk outer[GRID_MAX_LEVELS - 1], walk;
    u32 depth = 0;
    if (!clip_to_box(box, space, &t0, &t1) || !walk.begin(all, 0, along, t0, t1)) return;
    for (;;) {
        GridCell cell = all.cells[walk.cell()];
        count.node(sizeof(GridCell), 1);
        if (cell.count & GRID_CELL_DIVIDED) {
            const GridShape& shape = all.grids[cell.first].shape;
            count.node(sizeof(CellGrid), 1);
            t0 = walk.from();
            t1 = min_f(walk.to(), leaf.limit());
            if (clip_to_box(box, {shape.lo, shape.hi}, &t0, &t1)) {
                outer[depth] = walk;
                if (walk.begin(all, cell.first, along, t0, t1)) {
                    ++depth;
                    continue;
                }
                walk = outer[depth];
            }
        } else if (cell.count != 0 && leaf.offer(all.refs + cell.first, cell.count)) {
            return;
        }
        while (!walk.advance(along, leaf.limit())) {
            if (depth == 0) return;
            walk = outer[--depth];
        }
    }
}

template <Precision P, class Count>
LUCH_FN void closest_hit(const HierarchicalGrid& grid, const Primitives& all, const Ray& ray, RefHit* best,
                         Count& count) {
    ClosestInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, best, count, {}};
    walk_hierarchical_grid(grid, ray, leaf, count);
}

template <Precision P, class Count>
LUCH_FN u8 any_hit(const HierarchicalGrid& grid, const Primitives& all, const Ray& ray, Count& count) {
    AnyInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count, {}};
    walk_hierarchical_grid(grid, ray, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

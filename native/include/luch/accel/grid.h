// The uniform grid: cells of equal size in Z-order, each with the primitives that touch it.
//
// Two ways along a ray (the cone of math/bounds.h, 1: some point Q of a hit at t is within the cone at t and in the
// primitive's widened box):
// - GridLine steps from cell to cell as the line does (3D-DDA; Amanatides, Woo 1987). A primitive stands in every cell
//   that it touches when the cell is widened by the margin, GRID_MARGIN of a cell's width along each axis. At t the
//   line is in the cell in which the walk is at t, but for what was rounded. With D the largest distance along an axis
//   from the origin to the far side of the grid, that is at most 10 EPS D for a crossing's t (three roundings of
//   (lo - o) / d, four of k width / d, one sum), 8 EPS D for the first cell, EPS D for the hit's t, EPS D where a ray
//   counts as parallel to a plane; the cone adds 8 EPS D. Together less than GRID_DOUBT EPS D, so where that is
//   within the margin the cells of the walk hold every hit.
// - GridSlabs, for rays from far away (or numbers beyond the range): for each layer of cells across the dominant axis
//   all cells that the cone may meet while it may be in the layer, in double.
// A cell's t interval holds the t of all hits that it must find, so the walk ends when an interval begins beyond the
// best t (not at it: a smaller ref may follow). Cells at the border reach outwards without end.
#pragma once
#include "luch/accel/cell_refs.h"
#include "luch/math/bounds.h"

namespace luch {

inline constexpr u32 GRID_MAX_BITS = 28;  // 2^28 cells

struct GridShape {
    Vec3 lo, hi;  // holds every primitive's widened box
    float width[3], inverse[3];
    u32 size[3];  // powers of two
    u32 mask[3];  // which bits of a cell's number are its x, y, z: Z-order
    float reach;  // GridLine serves origins with D up to this
};

struct Grid {
    GridShape shape;
    const u32* first;  // cell c has refs[first[c]] to refs[first[c + 1]]
    const u32* refs;
};

// The bits of i moved to those of mask, from the lowest on.
LUCH_FN u32 spread_bits(u32 i, u32 mask) {
    u32 out = 0;
    for (; i != 0; i >>= 1) {
        u32 lowest = mask & (0 - mask);
        out |= (i & 1u) ? lowest : 0u;
        mask ^= lowest;
    }
    return out;
}

// What of a ray the walks need.
struct GridRay {
    Vec3 origin, direction;
    float steepest;             // of the direction's components, absolute
    float nearest_d, farthest_d;  // D that GridLine's numbers can hold
    float rdir[3];              // 0: as good as parallel to the axis' planes

    LUCH_FN explicit GridRay(const Ray& ray)
        : origin(ray.origin), direction(ray.direction), steepest(max_component(abs_v(ray.direction))) {
        bool in_range = steepest >= 1e-30f && steepest <= 1e30f;
        nearest_d = in_range ? 1e-24f * steepest : INFINITE_DISTANCE;
        farthest_d = 1e24f * steepest;
        for (int axis = 0; axis < 3; ++axis) {
            float d = direction[axis];
            rdir[axis] = abs_f(d) <= EPS * steepest ? 0.0f : 1.0f / d;
        }
    }
};

// Whether GridLine may walk this grid: the margin holds its doubt, and no number leaves the range.
LUCH_FN bool grid_line_serves(const GridShape& grid, const GridRay& ray) {
    Vec3 away = max_v(abs_v(grid.lo - ray.origin), abs_v(grid.hi - ray.origin));
    float d = max_component(away);
    return d <= grid.reach && d >= ray.nearest_d && d <= ray.farthest_d;
}

struct GridLine {
    struct Axis {
        float base, delta;  // the line crosses plane k at base + k delta
        float plane, step, last;
        float t;            // of the next crossing; infinite behind the last one
        u32 code, mask, add;

        LUCH_FN void begin(const GridShape& grid, const GridRay& ray, int axis, float t0) {
            float relative = ray.origin[axis] - grid.lo[axis], d = ray.direction[axis];
            float at = (relative + t0 * d) * grid.inverse[axis];
            u32 most = grid.size[axis] - 1;
            u32 i = at > 0.0f ? (at < float(most) ? u32(at) : most) : 0u;
            mask = grid.mask[axis];
            code = spread_bits(i, mask);
            float rdir = ray.rdir[axis];
            bool negative = d < 0.0f, parallel = rdir == 0.0f;
            base = -relative * rdir;
            delta = grid.width[axis] * rdir;
            step = negative ? -1.0f : 1.0f;
            add = negative ? ~0u : 0u - mask;  // of spread bits: -1 and +1
            plane = float(negative ? i : i + 1);
            last = parallel ? plane : (negative ? 0.0f : float(grid.size[axis]));
            t = plane == last ? INFINITE_DISTANCE : base + plane * delta;
        }
        LUCH_FN void cross(bool whether) {
            plane += whether ? step : 0.0f;
            code = (code + (whether ? add : 0u)) & mask;
            t = plane == last ? INFINITE_DISTANCE : base + plane * delta;
        }
    };
    Axis x, y, z;
    float from, to;  // the interval of the current cell

    LUCH_FN void begin(const GridShape& grid, const GridRay& ray, float t0) {
        x.begin(grid, ray, 0, t0);
        y.begin(grid, ray, 1, t0);
        z.begin(grid, ray, 2, t0);
        from = t0;
        to = min_f(x.t, min_f(y.t, z.t));
    }
    LUCH_FN u32 cell() const { return x.code | y.code | z.code; }
    LUCH_FN bool advance(float limit) {
        if (!(to <= limit)) return false;
        bool over_x = x.t == to, over_y = !over_x && y.t == to;
        x.cross(over_x);
        y.cross(over_y);
        z.cross(!over_x && !over_y);
        from = to;
        to = min_f(x.t, min_f(y.t, z.t));
        return true;
    }
};

struct GridSlabs {
    const GridShape* grid;
    float t0, t1;  // of the ray in the grid
    int axis, across[2];
    u32 layer, layers_left;
    u32 first[2], last[2], at[2];  // cells of the layer that the cone may meet
    float from, to;

    LUCH_FN double plane(int a, u32 k) const {
        if (k == 0) return double(grid->lo[a]);
        return k == grid->size[a] ? double(grid->hi[a]) : double(grid->lo[a]) + double(k) * double(grid->width[a]);
    }
    LUCH_FN u32 index(int a, double x) const {
        double i = (x - double(grid->lo[a])) / double(grid->width[a]);
        u32 most = grid->size[a] - 1;
        return i > 0 ? (i < double(most) ? u32(i) : most) : 0u;  // NaN, a cell without width: 0
    }
    LUCH_FN bool begin(const GridShape& shape, const GridRay& ray, float begin_t, float end_t) {
        grid = &shape;
        t0 = begin_t;
        t1 = end_t;
        Vec3 steep = abs_v(ray.direction);
        axis = steep.x == ray.steepest ? 0 : (steep.y == ray.steepest ? 1 : 2);
        across[0] = axis == 0 ? 1 : 0;
        across[1] = axis == 2 ? 1 : 2;
        layers_left = grid->size[axis];
        layer = ray.direction[axis] < 0.0f ? layers_left : ~0u;  // one before the first
        return next_layer(ray, end_t);
    }
    // The interval in which the cone may be in the layer, and its cells; false if that is over or behind.
    LUCH_FN bool enter_layer(const GridRay& ray) {
        bool negative = ray.direction[axis] < 0.0f;
        double o = double(ray.origin[axis]), d = double(ray.steepest), most = double(GRID_DOUBT) * double(EPS);
        double near_by = negative ? o - plane(axis, layer + 1) : plane(axis, layer) - o;
        double far_by = negative ? o - plane(axis, layer) : plane(axis, layer + 1) - o;
        double enter = near_by / (d * (1 + most)), leave = far_by / (d * (1 - most));
        enter = enter > double(t0) ? enter : double(t0);
        leave = leave < double(t1) ? leave : double(t1);
        if (!(enter <= leave)) return false;
        from = float(enter) * SLAB_DOWN;
        to = float(leave) * SLAB_UP;
        for (int k = 0; k < 2; ++k) {
            int a = across[k];
            double slope = double(ray.direction[a]), p = double(ray.origin[a]) + enter * slope;
            double q = double(ray.origin[a]) + leave * slope, doubt = most * d * leave;
            first[k] = index(a, (p < q ? p : q) - doubt);
            last[k] = index(a, (p < q ? q : p) + doubt);
            at[k] = first[k];
        }
        return true;
    }
    LUCH_FN bool next_layer(const GridRay& ray, float limit) {
        while (layers_left > 0) {
            --layers_left;
            layer += ray.direction[axis] < 0.0f ? ~0u : 1u;
            if (enter_layer(ray)) return from <= limit;
        }
        return false;
    }
    LUCH_FN u32 cell() const {
        return spread_bits(layer, grid->mask[axis]) | spread_bits(at[0], grid->mask[across[0]]) |
               spread_bits(at[1], grid->mask[across[1]]);
    }
    LUCH_FN bool advance(const GridRay& ray, float limit) {
        if (!(from <= limit)) return false;
        if (at[0]++ < last[0]) return true;
        at[0] = first[0];
        return at[1]++ < last[1] || next_layer(ray, limit);
    }
};

// Offers the refs of the cells along the ray, near to far, to leaf (cell_refs.h).
template <class Leaf, class Count>
LUCH_FN void walk_grid(const Grid& grid, const Ray& ray, Leaf& leaf, Count& count) {
    float t0 = ray.t_min, t1 = leaf.limit();
    Box box = {grid.shape.lo, grid.shape.hi};
    if (!clip_to_box(make_box_ray(ray.origin, ray.direction, box), box, &t0, &t1)) return;
    GridRay along(ray);
    auto offer = [&](u32 cell) {
        u32 first = grid.first[cell], end = grid.first[cell + 1];
        count.node(2 * sizeof(u32), 1);
        return first != end && leaf.offer(grid.refs + first, end - first);
    };
    if (grid_line_serves(grid.shape, along)) {
        GridLine line;
        line.begin(grid.shape, along, t0);
        do {
            if (offer(line.cell())) return;
        } while (line.advance(min_f(leaf.limit(), t1)));
        return;
    }
    GridSlabs slabs;
    if (!slabs.begin(grid.shape, along, t0, t1)) return;
    do {
        if (offer(slabs.cell())) return;
    } while (slabs.advance(along, min_f(leaf.limit(), t1)));
}

template <Precision P, class Count>
LUCH_FN void closest_hit(const Grid& grid, const Primitives& all, const Ray& ray, RefHit* best, Count& count) {
    ClosestInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, best, count, {}};
    walk_grid(grid, ray, leaf, count);
}

template <Precision P, class Count>
LUCH_FN u8 any_hit(const Grid& grid, const Primitives& all, const Ray& ray, Count& count) {
    AnyInCell<P, Count> leaf = {all, PrimitiveRay<P>(ray), ray.t_min, ray.t_max, BLOCKED_NOT, count, {}};
    walk_grid(grid, ray, leaf, count);
    return leaf.blocked;
}

}  // namespace luch

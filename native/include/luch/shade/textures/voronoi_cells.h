// Voronoi cells: one pseudo-random point per unit cell, and what can be asked about the nearest ones.
// Sources: Worley 1996; Quilez, "Voronoi distances", 2012; values as in Blender's Voronoi Texture.
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/textures/hash.h"

namespace luch {

enum class VoronoiMetric : u32 { EUCLIDEAN, MANHATTAN, CHEBYCHEV, MINKOWSKI };
enum class VoronoiFeature : u32 { F1, F2, SMOOTH_F1, DISTANCE_TO_EDGE, N_SPHERE_RADIUS };

template <class F>
struct VoronoiSettings {
    F randomness, smoothness, exponent;
    VoronoiMetric metric;
};

template <class F, int D>
struct VoronoiHit {
    F distance;
    Coord<F, 3> color;
    Coord<F, D> position;  // of the cell's point
};

inline constexpr float FARTHEST = 3.402823466e+38f;

LUCH_FN constexpr int int_power(int base, int exponent) {
    int r = 1;
    for (int k = 0; k < exponent; k++) r *= base;
    return r;
}

// Where a lane stands: its cell, and its place inside the cell.
template <class F, int D>
struct CellFrame {
    F base[D];
    IntOf<F> cell[D];
    F local[D];

    LUCH_FN explicit CellFrame(const Coord<F, D>& p) {
        LUCH_UNROLL for (int d = 0; d < D; d++) {
            const F x = lane_clamp(lane_tame(p.x[d]), -2147483000.0f, 2147483000.0f);
            base[d] = lane_floor(x);
            cell[d] = lane_int(base[d]);
            local[d] = x - base[d];
        }
    }

    // Hash of the cell at an offset: the place of its point, 0..1 per axis.
    LUCH_FN Coord<F, D> random_place(const IntOf<F> (&offset)[D]) const {
        if constexpr (D == 1) {
            return {{hash_unit(base[0] + lane_float(offset[0]))}};
        } else {
            IntOf<F> at[D];
            LUCH_UNROLL for (int d = 0; d < D; d++) at[d] = cell[d] + offset[d];
            return hash_cell<F, D>(at);
        }
    }
    LUCH_FN Coord<F, 3> random_color(const IntOf<F> (&offset)[D]) const {
        if constexpr (D == 1) {
            const F at = base[0] + lane_float(offset[0]);
            return {{hash_unit(at), hash_unit(at, spread<F>(1.0f)), hash_unit(at, spread<F>(2.0f))}};
        } else if constexpr (D == 2) {
            const IntOf<F> at[3] = {cell[0] + offset[0], cell[1] + offset[1], IntOf<F>{}};
            return hash_cell<F, 3>(at);
        } else {
            const Coord<F, D> h = random_place(offset);
            return {{h.x[0], h.x[1], h.x[2]}};
        }
    }
    // The cell's point, relative to the lane's own cell.
    LUCH_FN Coord<F, D> point(const IntOf<F> (&offset)[D], F randomness) const {
        Coord<F, D> q = random_place(offset);
        LUCH_UNROLL for (int d = 0; d < D; d++) q.x[d] = lane_float(offset[d]) + q.x[d] * randomness;
        return q;
    }
};

// Offset number n of the (2 reach + 1)^D cells around, x fastest. Returns its code: 2 bits per axis.
template <class F, int D>
LUCH_FN int cell_offset(int n, int reach, IntOf<F> (&offset)[D]) {
    const int side = 2 * reach + 1;
    int code = 0;
    LUCH_UNROLL for (int d = 0; d < D; d++) {
        const int step = n % side - reach;
        offset[d] = IntOf<F>{} + step;
        code |= (step + 1) << (2 * d);
        n /= side;
    }
    return code;
}
// The offset of a code that differs from lane to lane (reach 1).
template <class F, int D>
LUCH_FN void decode_offset(IntOf<F> code, IntOf<F> (&offset)[D]) {
    LUCH_UNROLL for (int d = 0; d < D; d++) offset[d] = ((code >> (2 * d)) & 3) - 1;
}
inline constexpr int OWN_CELL = 0x55;  // the code of no offset, in up to four dimensions

template <class F, int D>
LUCH_FN F squared_length(const Coord<F, D>& v) {
    F sum = v.x[0] * v.x[0];
    LUCH_UNROLL for (int d = 1; d < D; d++) sum = sum + v.x[d] * v.x[d];
    return sum;
}
template <class F, int D>
LUCH_FN Coord<F, D> subtract(Coord<F, D> a, const F (&b)[D]) {
    LUCH_UNROLL for (int d = 0; d < D; d++) a.x[d] = a.x[d] - b[d];
    return a;
}

// A number that orders points as their distance does, and is cheaper.
template <class F, int D>
LUCH_FN F distance_order(const Coord<F, D>& v, const VoronoiSettings<F>& s) {
    if constexpr (D == 1) return lane_abs(v.x[0]);
    if (s.metric == VoronoiMetric::EUCLIDEAN) return squared_length(v);
    F r = lane_abs(v.x[0]);
    if (s.metric == VoronoiMetric::MINKOWSKI) {
        r = lane_pow(r, s.exponent);
        LUCH_UNROLL for (int d = 1; d < D; d++) r = r + lane_pow(lane_abs(v.x[d]), s.exponent);
        return r;
    }
    const bool sum = s.metric == VoronoiMetric::MANHATTAN;
    LUCH_UNROLL for (int d = 1; d < D; d++) {
        const F a = lane_abs(v.x[d]);
        r = sum ? r + a : lane_max(r, a);
    }
    return r;
}
template <class F, int D>
LUCH_FN F distance_from_order(F order, const VoronoiSettings<F>& s) {
    if constexpr (D == 1) return order;
    if (s.metric == VoronoiMetric::EUCLIDEAN) return lane_sqrt(order);
    if (s.metric == VoronoiMetric::MINKOWSKI) return lane_pow(order, 1.0f / s.exponent);
    return order;
}

// The nearest (SECOND: second nearest) point.
template <class F, int D, bool SECOND>
LUCH_FN VoronoiHit<F, D> nearest_point(const Coord<F, D>& p, const VoronoiSettings<F>& s) {
    const CellFrame<F, D> frame(p);
    F first = spread<F>(FARTHEST), second = first;
    IntOf<F> first_cell = IntOf<F>{} + OWN_CELL, second_cell = first_cell;
    for (int n = 0; n < int_power(3, D); n++) {
        IntOf<F> offset[D];
        const IntOf<F> number = IntOf<F>{} + cell_offset<F, D>(n, 1, offset);
        const F order = distance_order(subtract(frame.point(offset, s.randomness), frame.local), s);
        const auto nearer = order < first;
        if constexpr (SECOND) {
            // What the nearest loses, the second may take.
            const F rest = select(nearer, first, order);
            const IntOf<F> rest_cell = select(nearer, first_cell, number);
            const auto takes = nearer | (rest < second);
            second = select(takes, rest, second);
            second_cell = select(takes, rest_cell, second_cell);
        }
        first = select(nearer, order, first);
        first_cell = select(nearer, number, first_cell);
    }
    IntOf<F> offset[D];
    decode_offset<F, D>(SECOND ? second_cell : first_cell, offset);
    VoronoiHit<F, D> hit;
    hit.position = frame.point(offset, s.randomness);
    hit.distance = distance_from_order<F, D>(SECOND ? second : first, s);
    hit.color = frame.random_color(offset);
    LUCH_UNROLL for (int d = 0; d < D; d++) hit.position.x[d] = hit.position.x[d] + frame.base[d];
    return hit;
}

// The nearest point where neighbours blend into each other; smoothness in (0, 0.5].
template <class F, int D>
LUCH_FN VoronoiHit<F, D> smooth_nearest_point(const Coord<F, D>& p, const VoronoiSettings<F>& s) {
    const CellFrame<F, D> frame(p);
    VoronoiHit<F, D> hit{};
    const F spread_correction = 1.0f / (1.0f + 3.0f * s.smoothness);
    for (int n = 0; n < int_power(5, D); n++) {
        IntOf<F> offset[D];
        cell_offset<F, D>(n, 2, offset);
        const Coord<F, D> point = frame.point(offset, s.randomness);
        const F distance = distance_from_order<F, D>(distance_order(subtract(point, frame.local), s), s);
        F h = lane_clamp(0.5f + 0.5f * (hit.distance - distance) / s.smoothness, 0.0f, 1.0f);
        h = n == 0 ? spread<F>(1.0f) : h * h * (3.0f - 2.0f * h);
        const F dip = s.smoothness * h * (1.0f - h);
        hit.distance = lane_mix(hit.distance, distance, h) - dip;
        const F dip_rest = dip * spread_correction;
        const Coord<F, 3> color = frame.random_color(offset);
        LUCH_UNROLL for (int c = 0; c < 3; c++) hit.color.x[c] = lane_mix(hit.color.x[c], color.x[c], h) - dip_rest;
        LUCH_UNROLL for (int d = 0; d < D; d++) {
            hit.position.x[d] = lane_mix(hit.position.x[d], point.x[d], h) - dip_rest;
        }
    }
    LUCH_UNROLL for (int d = 0; d < D; d++) hit.position.x[d] = hit.position.x[d] + frame.base[d];
    return hit;
}

// Distance to the nearest border between two cells.
template <class F, int D>
LUCH_FN F edge_distance(const Coord<F, D>& p, F randomness) {
    const CellFrame<F, D> frame(p);
    if constexpr (D == 1) {
        const IntOf<F> left[1] = {IntOf<F>{} - 1}, here[1] = {IntOf<F>{}}, right[1] = {IntOf<F>{} + 1};
        const F middle = frame.point(here, randomness).x[0];
        const F to_left = (middle + frame.point(left, randomness).x[0]) * 0.5f;
        const F to_right = (middle + frame.point(right, randomness).x[0]) * 0.5f;
        return lane_min(lane_abs(to_left - frame.local[0]), lane_abs(to_right - frame.local[0]));
    } else {
        F nearest_order = spread<F>(FARTHEST);
        Coord<F, D> nearest{};
        IntOf<F> offset[D];
        for (int n = 0; n < int_power(3, D); n++) {
            cell_offset<F, D>(n, 1, offset);
            const Coord<F, D> v = subtract(frame.point(offset, randomness), frame.local);
            const F order = squared_length(v);
            const auto nearer = order < nearest_order;
            nearest_order = select(nearer, order, nearest_order);
            LUCH_UNROLL for (int d = 0; d < D; d++) nearest.x[d] = select(nearer, v.x[d], nearest.x[d]);
        }
        F distance = spread<F>(FARTHEST);
        for (int n = 0; n < int_power(3, D); n++) {
            cell_offset<F, D>(n, 1, offset);
            const Coord<F, D> v = subtract(frame.point(offset, randomness), frame.local);
            const Coord<F, D> across = subtract(v, nearest.x);
            F along = (nearest.x[0] + v.x[0]) * across.x[0];
            LUCH_UNROLL for (int d = 1; d < D; d++) along = along + (nearest.x[d] + v.x[d]) * across.x[d];
            const F length_2 = squared_length(across);
            const F edge = 0.5f * along / lane_sqrt(length_2);
            distance = select((length_2 > VORONOI_SAME_POINT) & (edge < distance), edge, distance);
        }
        return distance;
    }
}

// Radius of the largest sphere around the nearest point that stays within half way to its neighbour.
template <class F, int D>
LUCH_FN F sphere_radius(const Coord<F, D>& p, F randomness) {
    const CellFrame<F, D> frame(p);
    F order = spread<F>(FARTHEST);
    IntOf<F> cell = IntOf<F>{} + OWN_CELL;
    IntOf<F> offset[D], home[D];
    for (int n = 0; n < int_power(3, D); n++) {
        const IntOf<F> code = IntOf<F>{} + cell_offset<F, D>(n, 1, offset);
        const F o = squared_length(subtract(frame.point(offset, randomness), frame.local));
        const auto nearer = o < order;
        order = select(nearer, o, order);
        cell = select(nearer, code, cell);
    }
    decode_offset<F, D>(cell, home);
    const Coord<F, D> point = frame.point(home, randomness);
    order = spread<F>(FARTHEST);
    for (int n = 0; n < int_power(3, D); n++) {
        if (n == int_power(3, D) / 2) continue;
        cell_offset<F, D>(n, 1, offset);
        LUCH_UNROLL for (int d = 0; d < D; d++) offset[d] = offset[d] + home[d];
        order = lane_min(order, squared_length(subtract(frame.point(offset, randomness), point.x)));
    }
    return lane_sqrt(order) * 0.5f;
}

}  // namespace luch

// Voronoi Texture.
//
// operation          inputs                                             outputs           params
// VORONOI_1D..4D     0..2 vector, 3 w, 4 scale, 5 detail, 6 roughness,  0 distance,       0 VoronoiFeature (F1, F2,
//                    7 lacunarity, 8 smoothness, 9 exponent,            1..3 color,         SMOOTH_F1),
//                    10 randomness                                      4..6 position,    1 VoronoiMetric,
//                                                                       7 w               2 normalize (0/1)
// VORONOI_EDGE_1D..  the same                                           0 distance        0 normalize
// VORONOI_RADIUS_1D..  the same                                         0 radius          none
#pragma once
#include "luch/shade/textures/lane_op.h"
#include "luch/shade/textures/voronoi_cells.h"

namespace luch {

template <class F>
struct VoronoiInputs {
    F scale, detail, roughness, lacunarity, smoothness, exponent, randomness;

    LUCH_FN explicit VoronoiInputs(const F* in) {
        scale = in[4];
        detail = lane_clamp(in[5], 0.0f, 15.0f);
        roughness = lane_clamp(in[6], 0.0f, 1.0f);
        lacunarity = in[7];
        smoothness = lane_clamp(in[8] * 0.5f, 0.0f, 0.5f);
        exponent = in[9];
        randomness = lane_clamp(in[10], 0.0f, 1.0f);
    }
    // Detail of lanes that have more than one octave; the others get none.
    LUCH_FN F octaves() const { return select((detail == 0.0f) | (roughness == 0.0f), F{}, detail); }
};

template <class F, int D>
LUCH_FN_SLOW VoronoiHit<F, D> voronoi_octave(const Coord<F, D>& p, const VoronoiSettings<F>& s,
                                             VoronoiFeature feature) {
    if (feature == VoronoiFeature::F2) return nearest_point<F, D, true>(p, s);
    const auto sharp = s.smoothness == 0.0f;
    if (feature == VoronoiFeature::F1 || !any_lane(s.smoothness != 0.0f)) return nearest_point<F, D, false>(p, s);
    VoronoiHit<F, D> hit = smooth_nearest_point<F, D>(p, s);
    if (any_lane(sharp)) {
        const VoronoiHit<F, D> plain = nearest_point<F, D, false>(p, s);
        hit.distance = select(sharp, plain.distance, hit.distance);
        for (int c = 0; c < 3; c++) hit.color.x[c] = select(sharp, plain.color.x[c], hit.color.x[c]);
        for (int d = 0; d < D; d++) hit.position.x[d] = select(sharp, plain.position.x[d], hit.position.x[d]);
    }
    return hit;
}

// Distance from one corner of a cell's random range to the other: the largest distance to be met.
template <class F, int D>
LUCH_FN F largest_distance(const VoronoiSettings<F>& s, VoronoiFeature feature) {
    Coord<F, D> reach;
    for (int d = 0; d < D; d++) reach.x[d] = 0.5f + 0.5f * s.randomness;
    const F distance = distance_from_order<F, D>(distance_order(reach, s), s);
    return feature == VoronoiFeature::F2 ? distance * 2.0f : distance;
}

template <int D>
struct OpVoronoi : LaneOp<OpVoronoi<D>> {
    static constexpr int inputs = 11, outputs = 8, params = 3;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        const VoronoiInputs<F> v(in);
        const auto feature = VoronoiFeature(params[0]);
        const VoronoiSettings<F> s{v.randomness, v.smoothness, v.exponent, VoronoiMetric(params[1])};
        const Coord<F, D> p = texture_coord<F, D>(in, in[3], v.scale);
        VoronoiHit<F, D> sum = voronoi_octave<F, D>(p, s, feature);
        F total = spread<F>(1.0f);
        const F detail = v.octaves();
        if (any_lane(detail > 0.0f)) add_octaves(p, s, feature, v, detail, sum, total);
        if (params[2]) {
            sum.distance = sum.distance / (total * largest_distance<F, D>(s, feature));
            for (int c = 0; c < 3; c++) sum.color.x[c] = sum.color.x[c] / total;
        }
        write(sum, v.scale, out);
    }

 private:
    // Octave 0 is in `sum` already, at full amplitude.
    template <class F>
    LUCH_FN static void add_octaves(const Coord<F, D>& p, const VoronoiSettings<F>& s, VoronoiFeature feature,
                                    const VoronoiInputs<F>& v, F detail, VoronoiHit<F, D>& sum, F& total) {
        F amplitude = v.roughness, frequency = v.lacunarity;
        const int longest = int(largest_lane(lane_ceil(detail)));
        for (int i = 1; i <= longest; i++) {
            const VoronoiHit<F, D> octave = voronoi_octave<F, D>(p * frequency, s, feature);
            // 1 for a whole octave, the fraction of detail for the last one, 0 past it.
            const F share = lane_clamp(detail - float(i - 1), 0.0f, 1.0f);
            const F whole = select(share == 1.0f, spread<F>(1.0f), F{});
            const F weight = amplitude * share;
            total = total + weight;
            sum.distance = sum.distance + octave.distance * weight;
            for (int c = 0; c < 3; c++) sum.color.x[c] = sum.color.x[c] + octave.color.x[c] * weight;
            for (int d = 0; d < D; d++) {
                sum.position.x[d] = lane_mix(sum.position.x[d], octave.position.x[d] / frequency, weight);
            }
            frequency = frequency * select(whole != 0.0f, v.lacunarity, spread<F>(1.0f));
            amplitude = amplitude * select(whole != 0.0f, v.roughness, spread<F>(1.0f));
        }
    }

    template <class F>
    LUCH_FN static void write(const VoronoiHit<F, D>& sum, F scale, F* out) {
        F position[4] = {};
        for (int d = 0; d < D; d++) {
            position[D == 1 ? 3 : d] = select(scale != 0.0f, sum.position.x[d] / scale, F{});
        }
        out[0] = lane_tame(sum.distance);
        for (int c = 0; c < 3; c++) out[1 + c] = lane_tame(sum.color.x[c]);
        for (int d = 0; d < 4; d++) out[4 + d] = lane_tame(position[d]);
    }
};

template <int D>
struct OpVoronoiEdge : LaneOp<OpVoronoiEdge<D>> {
    static constexpr int inputs = 11, outputs = 1, params = 1;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        constexpr float beyond = 8.0f;  // farther than any border
        const VoronoiInputs<F> v(in);
        const Coord<F, D> p = texture_coord<F, D>(in, in[3], v.scale);
        const F largest = 0.5f + 0.5f * v.randomness, detail = v.octaves();
        F total = largest;
        F distance = edge_distance<F, D>(p, v.randomness);
        if (any_lane(detail > 0.0f)) {
            const auto fractal = detail > 0.0f;
            const F first = distance;
            F amplitude = v.roughness, frequency = v.lacunarity;
            distance = lane_min(first, spread<F>(beyond));
            const int longest = int(largest_lane(lane_ceil(detail)));
            for (int i = 1; i <= longest; i++) {
                const F octave = edge_distance<F, D>(p * frequency, v.randomness) / frequency;
                const F share = lane_clamp(detail - float(i - 1), 0.0f, 1.0f);
                const auto whole = share == 1.0f;
                total = lane_mix(total, lane_mix(total, largest / frequency, amplitude), share);
                const F nearer = lane_mix(distance, lane_min(distance, octave), amplitude);
                distance = select(whole, nearer, lane_mix(distance, lane_min(distance, nearer), share));
                amplitude = amplitude * select(whole, v.roughness, spread<F>(1.0f));
                frequency = frequency * select(whole, v.lacunarity, spread<F>(1.0f));
            }
            distance = select(fractal, distance, first);
        }
        out[0] = lane_tame(params[0] ? distance / total : distance);
    }
};

template <int D>
struct OpVoronoiRadius : LaneOp<OpVoronoiRadius<D>> {
    static constexpr int inputs = 11, outputs = 1, params = 0;

    template <class F>
    LUCH_FN static void run(const u32*, const F* in, F* out) {
        const VoronoiInputs<F> v(in);
        out[0] = lane_tame(sphere_radius<F, D>(texture_coord<F, D>(in, in[3], v.scale), v.randomness));
    }
};

using OpVoronoi1D = OpVoronoi<1>;
using OpVoronoi2D = OpVoronoi<2>;
using OpVoronoi3D = OpVoronoi<3>;
using OpVoronoi4D = OpVoronoi<4>;
using OpVoronoiEdge1D = OpVoronoiEdge<1>;
using OpVoronoiEdge2D = OpVoronoiEdge<2>;
using OpVoronoiEdge3D = OpVoronoiEdge<3>;
using OpVoronoiEdge4D = OpVoronoiEdge<4>;
using OpVoronoiRadius1D = OpVoronoiRadius<1>;
using OpVoronoiRadius2D = OpVoronoiRadius<2>;
using OpVoronoiRadius3D = OpVoronoiRadius<3>;
using OpVoronoiRadius4D = OpVoronoiRadius<4>;

}  // namespace luch

// Noise Texture.
//
// operation         inputs                                              outputs          params
// NOISE_1D..4D      0..2 vector, 3 w, 4 scale, 5 detail, 6 roughness,   0 value          0 FractalType,
//                   7 lacunarity, 8 offset, 9 gain, 10 distortion                        1 normalize (0/1)
// NOISE_COLOR_1D..  the same                                            0 value, 1..3 color
#pragma once
#include "luch/shade/textures/fractal.h"
#include "luch/shade/textures/lane_op.h"

namespace luch {

// A point moved by a pseudo-random offset of 100 to 200 per axis: another, unrelated part of the noise.
template <class F, int D>
LUCH_FN Coord<F, D> unrelated(Coord<F, D> p, float seed) {
    if constexpr (D == 1) {
        p.x[0] = p.x[0] + (100.0f + hash_unit(seed) * 100.0f);
    } else {
        LUCH_UNROLL for (int d = 0; d < D; d++) p.x[d] = p.x[d] + (100.0f + hash_unit(seed, float(d)) * 100.0f);
    }
    return p;
}

template <int D, bool COLOR>
struct OpNoise : LaneOp<OpNoise<D, COLOR>> {
    static constexpr int inputs = 11, outputs = COLOR ? 4 : 1, params = 2;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        Coord<F, D> p = texture_coord<F, D>(in, in[3], in[4]);
        const FractalSettings<F> settings{lane_clamp(in[5], 0.0f, 15.0f), lane_max(in[6], F{}), in[7], in[8], in[9]};
        const F distortion = in[10];
        if (any_lane(distortion != 0.0f)) {
            Coord<F, D> moved = p;
            LUCH_UNROLL for (int d = 0; d < D; d++) {
                moved.x[d] = p.x[d] + signed_noise<F, D>(unrelated<F, D>(p, float(d))) * distortion;
            }
            p = moved;
        }
        const auto type = FractalType(params[0]);
        const bool normalize = params[1] != 0;
        const F value = fractal_noise<F, D>(p, settings, type, normalize);
        // Green and blue come first: an output may share its register with an input.
        if constexpr (COLOR) {
            out[2] = lane_tame(fractal_noise<F, D>(unrelated<F, D>(p, float(D)), settings, type, normalize));
            out[3] = lane_tame(fractal_noise<F, D>(unrelated<F, D>(p, float(D + 1)), settings, type, normalize));
            out[1] = lane_tame(value);
        }
        out[0] = lane_tame(value);
    }
};

using OpNoise1D = OpNoise<1, false>;
using OpNoise2D = OpNoise<2, false>;
using OpNoise3D = OpNoise<3, false>;
using OpNoise4D = OpNoise<4, false>;
using OpNoiseColor1D = OpNoise<1, true>;
using OpNoiseColor2D = OpNoise<2, true>;
using OpNoiseColor3D = OpNoise<3, true>;
using OpNoiseColor4D = OpNoise<4, true>;

}  // namespace luch

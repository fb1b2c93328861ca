// The simple patterns.
//
// operation       inputs                                                       outputs            params
// GRADIENT        0..2 vector                                                  0 factor           0 GradientType
// CHECKER         0..2 vector, 3..5 color 1, 6..8 color 2, 9 scale             0..2 color, 3 fac  none
// BRICK           0..2 vector, 3..5 color 1, 6..8 color 2, 9..11 mortar,       0..2 color, 3 fac  0 offset (float),
//                 12 scale, 13 mortar size, 14 mortar smooth, 15 bias,                            1 offset frequency,
//                 16 brick width, 17 row height                                                   2 squash (float),
//                                                                                                 3 squash frequency
// MAGIC           0..2 vector, 3 scale, 4 distortion                           0..2 color, 3 fac  0 depth 0..10
// WAVE            0..2 vector, 3 scale, 4 distortion, 5 detail,                0 factor           0 rings (0/1),
//                 6 detail scale, 7 detail roughness, 8 phase                                     1 direction,
//                                                                                                 2 WaveProfile
// WHITE_NOISE_1D..4D  0..2 vector, 3 w                                         0 value, 1..3 color  none
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/textures/fractal.h"
#include "luch/shade/textures/lane_op.h"

namespace luch {

// Unit coordinates fall on cell borders; this moves them off, the same way for every texture.
template <class F>
LUCH_FN F off_border(F x) {
    return (lane_tame(x) + OFF_BORDER) * (1.0f - OFF_BORDER);
}

enum class GradientType : u32 { LINEAR, QUADRATIC, EASING, DIAGONAL, RADIAL, QUADRATIC_SPHERE, SPHERICAL };

struct OpGradient : LaneOp<OpGradient> {
    static constexpr int inputs = 3, outputs = 1, params = 1;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        out[0] = lane_clamp(gradient(GradientType(params[0]), lane_tame(in[0]), lane_tame(in[1]), lane_tame(in[2])),
                            0.0f, 1.0f);
    }

 private:
    template <class F>
    LUCH_FN static F gradient(GradientType type, F x, F y, F z) {
        if (type == GradientType::LINEAR) return x;
        if (type == GradientType::DIAGONAL) return (x + y) * 0.5f;
        if (type == GradientType::RADIAL) return lane_atan2(y, x) * (0.5f * INV_PI) + 0.5f;
        if (type == GradientType::QUADRATIC) {
            const F r = lane_max(x, F{});
            return r * r;
        }
        if (type == GradientType::EASING) {
            const F r = lane_clamp(x, 0.0f, 1.0f);
            return r * r * (3.0f - 2.0f * r);
        }
        // Just short of 1, so that the unit sphere itself is exactly zero.
        const F r = lane_max((1.0f - OFF_BORDER) - lane_sqrt(x * x + y * y + z * z), F{});
        return type == GradientType::SPHERICAL ? r : r * r;
    }
};

// 1 where the floor of x is odd.
template <class F>
LUCH_FN F odd(F x) {
    const F cell = lane_floor(x);
    return cell - 2.0f * lane_floor(cell * 0.5f);
}

struct OpChecker : LaneOp<OpChecker> {
    static constexpr int inputs = 10, outputs = 4, params = 0;

    template <class F>
    LUCH_FN static void run(const u32*, const F* in, F* out) {
        const F scale = in[9];
        const F x = odd(off_border(in[0] * scale)), y = odd(off_border(in[1] * scale));
        const auto first = lane_abs(x - y) != odd(off_border(in[2] * scale));
        F color[3];
        for (int c = 0; c < 3; c++) color[c] = select(first, in[3 + c], in[6 + c]);
        for (int c = 0; c < 3; c++) out[c] = color[c];
        out[3] = select(first, spread<F>(1.0f), F{});
    }
};

struct OpBrick : LaneOp<OpBrick> {
    static constexpr int inputs = 18, outputs = 4, params = 4;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        const F scale = in[12], size = in[13], smooth = in[14], bias = in[15], height = in[17];
        F width = in[16];
        const F px = lane_tame(in[0] * scale), py = lane_tame(in[1] * scale);
        const F row = cell_number(py / height);
        F shift = F{};
        if (params[1] && params[3]) {
            width = select(multiple(row, params[3]), width * bits_float(params[2]), width);
            shift = select(multiple(row, params[1]), width * bits_float(params[0]), F{});
        }
        const F brick = cell_number((px + shift) / width);
        const F x = px + shift - width * brick, y = py - height * row;
        const F tint = lane_clamp(random_tint<F>(lane_int(row), lane_int(brick)) + bias, 0.0f, 1.0f);
        const F border = lane_min(lane_min(x, y), lane_min(width - x, height - y));
        const F depth = lane_clamp((1.0f - border / size) / smooth, 0.0f, 1.0f);
        F mortar = select(smooth == 0.0f, spread<F>(1.0f), depth * depth * (3.0f - 2.0f * depth));
        mortar = select(border >= size, F{}, mortar);
        for (int c = 0; c < 3; c++) {
            const F brick_color = select(mortar != 1.0f, (1.0f - tint) * in[3 + c] + tint * in[6 + c], in[3 + c]);
            out[c] = lane_tame(brick_color * (1.0f - mortar) + in[9 + c] * mortar);
        }
        out[3] = lane_tame(mortar);
    }

 private:
    template <class F>
    LUCH_FN static F cell_number(F x) {
        return lane_clamp(lane_floor(lane_tame(x)), -2147483000.0f, 2147483000.0f);
    }
    template <class F>
    LUCH_FN static MaskOf<F> multiple(F row, u32 n) {
        const float step = float(n);
        return row == step * lane_floor((row + 0.5f) / step);
    }
    // Integer noise of a brick's row and column.
    template <class F>
    LUCH_FN static F random_tint(IntOf<F> row, IntOf<F> brick) {
        auto n = (lane_word(row) << 16) + (lane_word(brick) & 0xffffu);
        n = (n + 1013u) & 0x7fffffffu;
        n = (n >> 13) ^ n;
        const auto m = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
        return 0.5f * (lane_float(lane_signed(m)) * (1.0f / 1073741824.0f));
    }
};

struct OpMagic : LaneOp<OpMagic> {
    static constexpr int inputs = 5, outputs = 4, params = 1;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        const int depth = int(params[0]);
        // Whole turns are taken out first: sums of large angles would lose the small one.
        const F px = angle(in[0] * in[3]), py = angle(in[1] * in[3]), pz = angle(in[2] * in[3]);
        F x = lane_sin((px + py + pz) * 5.0f);
        F y = lane_cos((py - px - pz) * 5.0f);
        F z = -lane_cos((pz - px - py) * 5.0f);
        const F d = lane_tame(in[4]);
        if (depth > 0) {
            x = x * d;
            y = y * d;
            z = z * d;
            y = -lane_cos(x - y + z) * d;
            if (depth > 1) x = lane_cos(x - y - z) * d;
            if (depth > 2) z = lane_sin(-x - y - z) * d;
            if (depth > 3) x = -lane_cos(y - x - z) * d;
            if (depth > 4) y = -lane_sin(y - x + z) * d;
            if (depth > 5) y = -lane_cos(y - x + z) * d;
            if (depth > 6) x = lane_cos(x + y + z) * d;
            if (depth > 7) z = lane_sin(x + y - z) * d;
            if (depth > 8) x = -lane_cos(z - x - y) * d;
            if (depth > 9) y = -lane_sin(x - y + z) * d;
        }
        const F divisor = select(d != 0.0f, d * 2.0f, spread<F>(1.0f));
        out[0] = lane_tame(0.5f - x / divisor);
        out[1] = lane_tame(0.5f - y / divisor);
        out[2] = lane_tame(0.5f - z / divisor);
        out[3] = (out[0] + out[1] + out[2]) * (1.0f / 3.0f);
    }

 private:
    template <class F>
    LUCH_FN static F angle(F x) {
        return lane_fmod(lane_tame(x), TWO_PI);
    }
};

enum class WaveProfile : u32 { SINE, SAW, TRIANGLE };

struct OpWave : LaneOp<OpWave> {
    static constexpr int inputs = 9, outputs = 1, params = 3;

    template <class F>
    LUCH_FN static void run(const u32* params, const F* in, F* out) {
        const F scale = in[3], distortion = in[4];
        const Coord<F, 3> p{{off_border(in[0] * scale), off_border(in[1] * scale), off_border(in[2] * scale)}};
        F n = (params[0] ? rings(p, int(params[1])) : bands(p, int(params[1]))) + in[8];
        if (any_lane(distortion != 0.0f)) {
            const FractalSettings<F> s{lane_clamp(in[5], 0.0f, 15.0f), in[7], spread<F>(2.0f), F{}, F{}};
            n = n + distortion * (fractal_noise<F, 3>(p * in[6], s, FractalType::FBM, true) * 2.0f - 1.0f);
        }
        n = lane_tame(n);
        const auto profile = WaveProfile(params[2]);
        const F turns = n * (1.0f / TWO_PI);
        if (profile == WaveProfile::SINE) {
            out[0] = 0.5f + 0.5f * lane_sin(n - 0.5f * PI);
        } else if (profile == WaveProfile::SAW) {
            out[0] = turns - lane_floor(turns);
        } else {
            out[0] = lane_abs(turns - lane_floor(turns + 0.5f)) * 2.0f;
        }
    }

 private:
    // Direction 0..2: along x, y, z; 3: diagonal, or around the origin.
    template <class F>
    LUCH_FN static F bands(const Coord<F, 3>& p, int direction) {
        return direction < 3 ? p.x[direction] * 20.0f : (p.x[0] + p.x[1] + p.x[2]) * 10.0f;
    }
    template <class F>
    LUCH_FN static F rings(const Coord<F, 3>& p, int direction) {
        const float x = direction == 0 ? 0.0f : 1.0f, y = direction == 1 ? 0.0f : 1.0f,
                    z = direction == 2 ? 0.0f : 1.0f;
        return lane_sqrt(x * p.x[0] * p.x[0] + y * p.x[1] * p.x[1] + z * p.x[2] * p.x[2]) * 20.0f;
    }
};

template <int D>
struct OpWhiteNoise : LaneOp<OpWhiteNoise<D>> {
    static constexpr int inputs = 4, outputs = 4, params = 0;

    template <class F>
    LUCH_FN static void run(const u32*, const F* in, F* out) {
        const F x = in[0], y = in[1], z = in[2], w = in[3], one = spread<F>(1.0f), two = spread<F>(2.0f);
        if constexpr (D == 1) {
            out[1] = hash_unit(w);
            out[2] = hash_unit(w, one);
            out[3] = hash_unit(w, two);
        } else if constexpr (D == 2) {
            out[1] = hash_unit(x, y);
            out[2] = hash_unit(x, y, one);
            out[3] = hash_unit(x, y, two);
        } else if constexpr (D == 3) {
            out[1] = hash_unit(x, y, z);
            out[2] = hash_unit(x, y, z, one);
            out[3] = hash_unit(x, y, z, two);
        } else {
            out[1] = hash_unit(x, y, z, w);
            out[2] = hash_unit(z, x, w, y);
            out[3] = hash_unit(w, z, y, x);
        }
        out[0] = out[1];
    }
};
using OpWhiteNoise1D = OpWhiteNoise<1>;
using OpWhiteNoise2D = OpWhiteNoise<2>;
using OpWhiteNoise3D = OpWhiteNoise<3>;
using OpWhiteNoise4D = OpWhiteNoise<4>;

}  // namespace luch

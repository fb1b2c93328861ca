// Gradient noise in one to four dimensions, as Blender's textures have it.
// Source: Perlin, "Improving Noise", 2002, with Jenkins' hash for the permutation.
#pragma once
#include "luch/shade/textures/hash.h"

namespace luch {

// x, negated where the given bit of h is set.
template <class F>
LUCH_FN F negate_by_bit(F x, WordOf<F> h, int bit) {
    return lane_from_bits(lane_bits(x) ^ ((h << (31 - bit)) & 0x80000000u));
}

// The dot product of the corner's pseudo-random gradient with the vector from the corner.
template <class F, int D>
LUCH_FN F corner_gradient(WordOf<F> h, const F (&v)[D]) {
    if constexpr (D == 1) {
        F slope = lane_float(lane_signed((h & 7u) + 1u));
        return negate_by_bit(slope, h, 3) * v[0];
    } else if constexpr (D == 2) {
        auto low = lane_signed(h & 7u) < 4;
        return negate_by_bit(select(low, v[0], v[1]), h, 0) + negate_by_bit(select(low, v[1], v[0]) * 2.0f, h, 1);
    } else if constexpr (D == 3) {
        IntOf<F> k = lane_signed(h & 15u);
        F second = select((k == 12) | (k == 14), v[0], v[2]);
        return negate_by_bit(select(k < 8, v[0], v[1]), h, 0) + negate_by_bit(select(k < 4, v[1], second), h, 1);
    } else {
        IntOf<F> k = lane_signed(h & 31u);
        return negate_by_bit(select(k < 24, v[0], v[1]), h, 0) + negate_by_bit(select(k < 16, v[1], v[2]), h, 1) +
               negate_by_bit(select(k < 8, v[2], v[3]), h, 2);
    }
}

template <class W, int D>
LUCH_FN W hash_corner(const W (&cell)[D], int corner) {
    const W x = cell[0] + u32(corner & 1);
    if constexpr (D == 1) {
        return hash_words(x);
    } else {
        const W y = cell[1] + u32((corner >> 1) & 1);
        if constexpr (D == 2) {
            return hash_words(x, y);
        } else {
            const W z = cell[2] + u32((corner >> 2) & 1);
            if constexpr (D == 3) {
                return hash_words(x, y, z);
            } else {
                return hash_words(x, y, z, cell[3] + u32((corner >> 3) & 1));
            }
        }
    }
}

// Raw gradient noise; |coordinates| < 2^31.
template <class F, int D>
LUCH_FN F gradient_noise(const Coord<F, D>& p) {
    WordOf<F> cell[D];
    F low[D], fade[D];
    LUCH_UNROLL for (int d = 0; d < D; d++) {
        const F base = lane_floor(p.x[d]);
        cell[d] = lane_word(lane_int(base));
        const F t = low[d] = p.x[d] - base;
        fade[d] = t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
    }
    F value[1 << D];
    LUCH_UNROLL for (int corner = 0; corner < (1 << D); corner++) {
        F offset[D];
        LUCH_UNROLL for (int d = 0; d < D; d++) offset[d] = ((corner >> d) & 1) ? low[d] - 1.0f : low[d];
        value[corner] = corner_gradient<F, D>(hash_corner<WordOf<F>, D>(cell, corner), offset);
    }
    LUCH_UNROLL for (int d = 0; d < D; d++) {
        LUCH_UNROLL for (int k = 0; k < (1 << (D - 1 - d)); k++) {
            value[k] = lane_mix(value[2 * k], value[2 * k + 1], fade[d]);
        }
    }
    return value[0];
}

// Noise in [-1, 1]. It repeats every 100000 units: beyond, floats would show their steps.
template <class F, int D>
LUCH_FN_SLOW F signed_noise(Coord<F, D> p) {
    constexpr float period = 100000.0f, far = 1000000.0f;
    constexpr float to_unit = D == 1 ? 0.25f : (D == 2 ? 0.6616f : (D == 3 ? 0.982f : 0.8344f));
    LUCH_UNROLL for (int d = 0; d < D; d++) {
        const F x = lane_tame(p.x[d]);
        p.x[d] = x;
        if (any_lane(lane_abs(x) >= period)) {
            p.x[d] = lane_fmod(x, period) + select(lane_abs(x) >= far, spread<F>(0.5f), F{});
        }
    }
    return gradient_noise<F, D>(p) * to_unit;
}

}  // namespace luch

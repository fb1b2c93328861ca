// Owen-scrambled Sobol points (Burley 2020, "Practical hash-based Owen scrambling"), padded: every
// dimension is its own one- or two-dimensional (0, m, s)-net, its order shuffled apart from the
// others. Stateless and branch-free: any (pixel, sample, dimension) costs the same, in any order,
// so loops over lanes vectorise and results do not depend on who computes them.
#pragma once
#include "luch/sampling/shuffle.h"

namespace luch {

// Second Sobol coordinate of an index, lowest bit first. Its matrix is Pascal's triangle modulo 2,
// so bit k is the parity of the index bits whose position contains k (Lucas): five folding steps.
LUCH_FN u32 pascal_fold(u32 x) {
    x ^= (x >> 16) & 0x0000ffffu;
    x ^= (x >> 8) & 0x00ff00ffu;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 2) & 0x33333333u;
    return x ^ ((x >> 1) & 0x55555555u);
}

LUCH_FN float sobol_1d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    u32 i = shuffled_index(s.index, hash);
    return unit_float(reverse_bits(scramble_upward(i, derive_seed(hash, 0x85ebca77u))));
}

LUCH_FN Vec2 sobol_2d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    u32 i = shuffled_index(s.index, hash);
    u32 x = scramble_upward(i, derive_seed(hash, 0x85ebca77u));
    u32 y = scramble_upward(pascal_fold(i), derive_seed(hash, 0xc2b2ae3du));
    return {unit_float(reverse_bits(x)), unit_float(reverse_bits(y))};
}

// Third Sobol coordinate, by bytes of the index: what each byte's bits add, lowest bit first. Direction
// numbers of the polynomial x^2 + x + 1 with m = 1, 3 (Joe and Kuo 2008, dimension 3).
struct ThirdSobolTable {
    u32 by_byte[4][256];

    LUCH_FN constexpr ThirdSobolTable() : by_byte{} {
        u32 m[32] = {1u, 3u};
        for (int k = 2; k < 32; ++k) m[k] = (m[k - 1] << 1) ^ (m[k - 2] << 2) ^ m[k - 2];
        for (int byte = 0; byte < 4; ++byte) {
            for (u32 value = 0; value < 256u; ++value) {
                for (int bit = 0; bit < 8; ++bit) {
                    if (!((value >> bit) & 1u)) continue;
                    int k = byte * 8 + bit;
                    // m[k] has k + 1 binary places; as bits of a fraction, first digit lowest.
                    for (int digit = 0; digit <= k; ++digit) {
                        if ((m[k] >> (k - digit)) & 1u) by_byte[byte][value] ^= 1u << digit;
                    }
                }
            }
        }
    }
};
LUCH_CONST ThirdSobolTable THIRD_SOBOL{};

LUCH_FN u32 third_fold(u32 i) {
    return THIRD_SOBOL.by_byte[0][i & 255u] ^ THIRD_SOBOL.by_byte[1][(i >> 8) & 255u] ^
           THIRD_SOBOL.by_byte[2][(i >> 16) & 255u] ^ THIRD_SOBOL.by_byte[3][i >> 24];
}

// A three-dimensional point of one sequence: x, y form a (0, m, 2)-net, and what a choice by z leaves of
// them is still well spread (a lamp or a lobe chosen by z, a place on it by x and y).
LUCH_FN Vec3 sobol_3d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    u32 i = shuffled_index(s.index, hash);
    u32 x = scramble_upward(i, derive_seed(hash, 0x85ebca77u));
    u32 y = scramble_upward(pascal_fold(i), derive_seed(hash, 0xc2b2ae3du));
    u32 z = scramble_upward(third_fold(i), derive_seed(hash, 0x27d4eb2fu));
    return {unit_float(reverse_bits(x)), unit_float(reverse_bits(y)), unit_float(reverse_bits(z))};
}

}  // namespace luch

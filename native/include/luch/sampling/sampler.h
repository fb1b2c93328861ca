// Owen-scrambled Sobol points (Burley 2020, "Practical hash-based Owen scrambling"), padded: every
// dimension is its own one- or two-dimensional (0, m, s)-net, its order shuffled apart from the
// others. Stateless and branch-free: any (pixel, sample, dimension) costs the same, in any order,
// so loops over lanes vectorise and results do not depend on who computes them.
#pragma once
#include "luch/math/vec.h"
#include "luch/sampling/hash.h"

namespace luch {

struct Sampler {
    u32 seed;   // scramble: pixels of one seed share a sequence, each its own piece of it
    u32 index;  // where in the sequence this sample stands
};

LUCH_FN u32 reverse_bits(u32 x) {
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

// Random nested flips, lowest bit first: bit k of the result depends on bits 0..k of x alone
// (Laine and Karras 2011; constants by Vegdahl 2021, psychopath.io "Building a better LK hash").
LUCH_FN u32 scramble_upward(u32 x, u32 seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

// Second Sobol coordinate of an index, lowest bit first. Its matrix is Pascal's triangle modulo 2,
// so bit k is the parity of the index bits whose position contains k (Lucas): five folding steps.
LUCH_FN u32 pascal_fold(u32 x) {
    x ^= (x >> 16) & 0x0000ffffu;
    x ^= (x >> 8) & 0x00ff00ffu;
    x ^= (x >> 4) & 0x0f0f0f0fu;
    x ^= (x >> 2) & 0x33333333u;
    return x ^ ((x >> 1) & 0x55555555u);
}

// One word of seed per use: multiply, then bring the well-mixed half down, since scramble_upward
// decides the first digits by the lowest bits.
LUCH_FN u32 derive_seed(u32 hash, u32 odd_factor) {
    u32 x = hash * odd_factor;
    return x ^ (x >> 16);
}

// Where sample `index` stands in the shuffled order of this dimension. Aligned blocks of 2^k
// indices stay aligned blocks of 2^k: each is a net of its own.
LUCH_FN u32 shuffled_index(u32 index, u32 hash) {
    return reverse_bits(scramble_upward(reverse_bits(index), derive_seed(hash, 0x9e3779b1u)));
}

LUCH_FN float sample_1d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    u32 i = shuffled_index(s.index, hash);
    return unit_float(reverse_bits(scramble_upward(i, derive_seed(hash, 0x85ebca77u))));
}

LUCH_FN Vec2 sample_2d(const Sampler& s, u32 dimension) {
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
LUCH_FN Vec3 sample_3d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    u32 i = shuffled_index(s.index, hash);
    u32 x = scramble_upward(i, derive_seed(hash, 0x85ebca77u));
    u32 y = scramble_upward(pascal_fold(i), derive_seed(hash, 0xc2b2ae3du));
    u32 z = scramble_upward(third_fold(i), derive_seed(hash, 0x27d4eb2fu));
    return {unit_float(reverse_bits(x)), unit_float(reverse_bits(y)), unit_float(reverse_bits(z))};
}

// Position of (x, y) on a Hilbert curve that fills a square of 2^levels pixels.
LUCH_FN u32 hilbert_index(u32 x, u32 y, u32 levels) {
    u32 d = 0;
    for (u32 level = levels; level-- > 0;) {
        u32 rx = (x >> level) & 1u, ry = (y >> level) & 1u;
        d = (d << 2) | ((3u * rx) ^ ry);
        u32 flip = (ry == 0u && rx == 1u) ? 0xffffffffu : 0u;
        u32 fx = x ^ flip, fy = y ^ flip;
        x = ry == 0u ? fy : fx;
        y = ry == 0u ? fx : fy;
    }
    return d;
}

// What of a pixel's sampler does not change from sample to sample.
struct PixelSampler {
    u32 seed, first_index;
};

// Neighbouring pixels take neighbouring pieces of one sequence (Ahmed and Wonka 2020): their errors
// then differ, and what noise is left looks fine-grained. log2_samples: the most samples the pixel
// will ever take, as a power of two; from 2^31 every pixel has a seed of its own instead.
LUCH_FN PixelSampler make_pixel_sampler(u32 x, u32 y, u32 seed, u32 log2_samples) {
    u32 room = log2_samples < 32u ? (32u - log2_samples) / 2u : 0u;
    u32 levels = room < 8u ? room : 8u;
    u32 mask = (1u << levels) - 1u;
    u32 tile_seed = hash_u32(seed, x >> levels, y >> levels);
    u32 piece = hilbert_index(x & mask, y & mask, levels);
    return {tile_seed, levels == 0u ? 0u : piece << log2_samples};
}

LUCH_FN Sampler make_sampler(const PixelSampler& pixel, u32 sample) { return {pixel.seed, pixel.first_index + sample}; }

}  // namespace luch

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

// Third Sobol coordinate of an index, lowest bit first: direction numbers of the polynomial x^2 + x + 1 with m = 1, 3 (Joe
// and Kuo 2008, dimension 3). As digits of a fraction, first digit lowest, those are polynomials r_k in y with r_0 = 1,
// r_1 = 1 + y, r_k = r_(k-1) + (1 + y^2) r_(k-2). With E for "the next one" E^2 + E = 1 + y^2, so an index, a polynomial
// in E, is written in powers of u = E^2 + E, each with a digit for 1 and one for E: E^16 = u^8 + E^8, E^8 = u^4 + E^4 and
// so on, four halvings. u^j is (1 + y^2)^j, Pascal's triangle over pairs of digits, and E is 1 + y: together what
// pascal_fold does.
LUCH_FN u32 third_fold(u32 x) {
    x ^= (x >> 8) & 0x00ff0000u;
    x ^= (x >> 8) & 0x0000ff00u;
    x ^= (x >> 4) & 0x0f000f00u;
    x ^= (x >> 4) & 0x00f000f0u;
    x ^= (x >> 2) & 0x30303030u;
    x ^= (x >> 2) & 0x0c0c0c0cu;
    x ^= (x >> 1) & 0x44444444u;
    x ^= (x >> 1) & 0x22222222u;
    return pascal_fold(x);
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

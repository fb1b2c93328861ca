// Rank-1 lattice sequences (Hickernell, Hong, L'Ecuyer, Lemieux 2000, "Extensible lattice sequences"), padded: the points
// of an aligned block of 2^m samples are the lattice of the multiples of (1, y, z) / 2^m, moved as a whole; every
// dimension moves it elsewhere (Cranley and Patterson 1976) and takes it in an order of its own. Half the work of Sobol.
#pragma once
#include "luch/sampling/shuffle.h"

namespace luch {

// Found by search (200,000 odd numbers and their pairs): the shortest distance between points of the lattices of
// (x, y), (x, z), (y, z), over the largest that any lattice of as many points has, is .465 or more for all of 2^2 to
// 2^26 points; that of planes which hold all points of (x, y, z) likewise .595, up to 2^13.
inline constexpr u32 LATTICE_Y = 3797975533u, LATTICE_Z = 753387963u;

// Which multiple: the radical inverse of where the sample stands in this dimension's order.
LUCH_FN u32 lattice_step(u32 index, u32 hash) {
    return scramble_upward(reverse_bits(index), derive_seed(hash, 0x9e3779b1u));
}

// Where the lattice begins, a word for each coordinate.
LUCH_FN u32 lattice_shift(u32 hash, u32 odd_factor) { return mix_u32(hash * odd_factor); }

LUCH_FN float lattice_1d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension);
    return unit_float(lattice_step(s.index, hash) + lattice_shift(hash, 0x85ebca77u));
}

LUCH_FN Vec2 lattice_2d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension), k = lattice_step(s.index, hash);
    u32 x = k + lattice_shift(hash, 0x85ebca77u), y = k * LATTICE_Y + lattice_shift(hash, 0xc2b2ae3du);
    return {unit_float(x), unit_float(y)};
}

LUCH_FN Vec3 lattice_3d(const Sampler& s, u32 dimension) {
    u32 hash = hash_u32(s.seed, dimension), k = lattice_step(s.index, hash);
    u32 x = k + lattice_shift(hash, 0x85ebca77u), y = k * LATTICE_Y + lattice_shift(hash, 0xc2b2ae3du);
    u32 z = k * LATTICE_Z + lattice_shift(hash, 0x27d4eb2fu);
    return {unit_float(x), unit_float(y), unit_float(z)};
}

}  // namespace luch

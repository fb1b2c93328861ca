// Random numbers that know nothing of each other, by hash: no two samples of a pixel are better spread than chance has
// it, so the relMSE falls as exactly one over their number. The plain yardstick for the other families.
#pragma once
#include "luch/sampling/shuffle.h"

namespace luch {

// A stream of its own for every seed and dimension; the sample is its counter, so none returns within 2^32.
LUCH_FN u32 independent_word(const Sampler& s, u32 dimension) { return hash_u32(s.seed, dimension, s.index); }

// Further coordinates of the same sample: the first has shown but 24 bits of a word that is mixed again.
LUCH_FN u32 next_word(u32 word) { return mix_u32(word + 0x9e3779b9u); }

LUCH_FN float independent_1d(const Sampler& s, u32 dimension) { return unit_float(independent_word(s, dimension)); }

LUCH_FN Vec2 independent_2d(const Sampler& s, u32 dimension) {
    u32 x = independent_word(s, dimension);
    return {unit_float(x), unit_float(next_word(x))};
}

LUCH_FN Vec3 independent_3d(const Sampler& s, u32 dimension) {
    u32 x = independent_word(s, dimension), y = next_word(x);
    return {unit_float(x), unit_float(y), unit_float(next_word(y))};
}

}  // namespace luch

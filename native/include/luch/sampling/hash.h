// Integer hashes: every seed in the renderer comes from these.
#pragma once
#include "luch/platform.h"

namespace luch {

// Bijective 32-bit mixer (Wellons, "Prospecting for hash functions", 2018: lowest bias found).
LUCH_FN u32 mix_u32(u32 x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

LUCH_FN u32 hash_u32(u32 a, u32 b) { return mix_u32(mix_u32(a) + 0x9e3779b9u * b); }
LUCH_FN u32 hash_u32(u32 a, u32 b, u32 c) { return hash_u32(hash_u32(a, b), c); }

// [0, 1), never 1: the upper 24 bits.
LUCH_FN float unit_float(u32 x) { return static_cast<float>(x >> 8) * 5.9604644775390625e-8f; }

}  // namespace luch

// One sample's number in one pixel, and orders of samples that keep aligned blocks of 2^k whole: what the families of
// points that come in such blocks have in common.
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

}  // namespace luch

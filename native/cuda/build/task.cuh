// Building the compressed wide tree on the GPU: what its kernels share.
#pragma once
#include "luch/accel/cwbvh.h"

namespace luch {

inline constexpr int BUILD_BLOCK = 64;  // threads; luch/cuda/builder.py launches as many
inline constexpr u32 ALL_LANES = 0xffffffffu;

// A node of the binary tree. Leaf: left is the ref, right is NONE.
struct BuildNode {
    float lo[3];
    u32 left;
    float hi[3];
    u32 right;
};
static_assert(sizeof(BuildNode) == 32);

enum BuildCounter : u32 { BINARY_NODES, ROOT, WIDE_NODES, LEAVES, ITEMS };

// Passed by value; luch/cuda/builder.py packs the same bytes. A kernel uses the fields that its step has filled.
struct BuildTask {
    const float* corners;  // by ref
    const u8* flags;       // by ref, or null
    u8* usable;            // by ref
    u32* refs;             // of those that can be hit; in order of their keys once sorted
    float* boxes;          // six floats each: lo, hi; in the same order
    u64* keys;
    BuildNode* nodes;      // leaves first, then 2 count - 1 in all
    u32* sizes;            // primitives below a node
    u32* clusters;         // by place: node ids that a range's first places hold
    u32* arrived;          // by place: the other end of the range that came to a split first, or NONE
    u32* counters;         // BuildCounter
    const u32* items;      // pairs: binary node, its wide node
    u32* next_items;
    CwbvhNode* wide;
    LeafPrimitive* leaves;
    float lo[3], scale;    // of the primitives' middles to 0..2^21
    u32 count;              // of what the kernel works on: a thread each
};

}  // namespace luch

#define LUCH_BUILD_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::BUILD_BLOCK) name

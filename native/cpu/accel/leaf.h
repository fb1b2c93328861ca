// A leaf of a group's tree: its blocks against one ray.
#pragma once
#include "cpu/accel/accel.h"
#include "cpu/accel/block_tests.h"
#include "cpu/accel/group.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {

LUCH_FN void offer(float t, u32 ref, float u, float v, RefHit* best) {
    if (is_closer(t, ref & REF_MASK, *best)) *best = {t, ref & REF_MASK, u, v};
}
LUCH_FN void note_blocked(u32 ref, u8* result) {
    if (!(ref & REF_TRANSPARENT))
        *result = BLOCKED_OPAQUE;
    else if (*result == BLOCKED_NOT)
        *result = BLOCKED_MAYBE;
}

template <class Block, class Count>
LUCH_FN void count_block(const Block& block, Count& count) {
    count.list(sizeof(Block));
    for (u32 ref : block.ref)
        if ((ref & REF_MASK) != REF_MASK) count.primitive(0);  // their bytes are the block's
}

template <class Block, class Count>
LUCH_FN void closest_in_leaf(const Group& group, const Block& ray, u32 leaf, RefHit* best, Count& count) {
    u32 first = leaf_first(leaf), end = first + leaf_items(leaf);
    for (u32 b = first; b < end; ++b) {
        const Block4& block = group.blocks[b];
        count_block(block, count);
        BlockHits hits;
        for (u32 mask = intersect_block(block, ray, best->t, &hits); mask; mask &= mask - 1) {
            u32 lane = u32(__builtin_ctz(mask));
            offer(hits.t[lane], block.ref[lane], hits.u[lane], hits.v[lane], best);
        }
    }
}

template <class Block, class Count>
LUCH_FN void any_in_leaf(const Group& group, const Block& ray, u32 leaf, float t_max, u8* result, Count& count) {
    u32 first = leaf_first(leaf), end = first + leaf_items(leaf);
    for (u32 b = first; b < end; ++b) {
        const Block4& block = group.blocks[b];
        count_block(block, count);
        BlockHits hits;
        for (u32 mask = intersect_block(block, ray, t_max, &hits); mask; mask &= mask - 1)
            note_blocked(block.ref[__builtin_ctz(mask)], result);
    }
}

}  // namespace luch::cpu

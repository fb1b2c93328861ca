// Primitives that are copies of another: every ray that meets one meets them all at the same t, where the smallest ref
// wins. No tree parts them, so a thousand in one place would all be tested by each ray: builders leave them out.
#pragma once
#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "luch/platform.h"

namespace luch::cpu {

// Of some words.
inline u32 hash_of_floats(const float* values, u32 count, u32 hash = 0) {
    for (u32 i = 0; i < count; ++i) hash = (hash ^ float_bits(values[i])) * 0x9e3779b1u + (hash >> 15);
    return hash ^ (hash >> 16);
}

// Finds copies of the last thousand or so primitives at some nanoseconds each: enough where few things lie in one place
// many times over, and all that a scene without any pays.
class CopySearch {
 public:
    // Whether the primitive is a copy of one seen before; else it is remembered. same(a, b) compares all of them.
    template <class Same>
    bool seen(u32 hash, u32 ref, Same&& same) {
        auto& [last, before] = slots_[hash % SLOTS];
        for (const Slot& slot : {last, before})
            if (slot.ref != NONE && slot.hash == hash && same(slot.ref, ref)) return true;
        before = last;
        last = {hash, ref};
        return false;
    }

 private:
    static constexpr u32 SLOTS = 512;
    struct Slot {
        u32 hash = 0, ref = NONE;
    };
    struct Pair {
        Slot last, before;  // both halves of a quad along the axes have one box, by which they are found
    };
    Pair slots_[SLOTS];
};

// Among all; items ascend by ref. hash(item), same(item, item); left_out(item) is told each copy. Returns how many stay.
template <class Item, class Hash, class Same, class LeftOut>
size_t leave_out_copies(Item* items, size_t count, Hash&& hash, Same&& same, LeftOut&& left_out) {
    std::unordered_multimap<u32, Item> known;
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
        u32 key = hash(items[i]);
        auto [first, last] = known.equal_range(key);
        if (std::any_of(first, last, [&](const auto& entry) { return same(entry.second, items[i]); })) {
            left_out(items[i]);
            continue;
        }
        known.emplace(key, items[i]);
        items[kept++] = items[i];
    }
    return kept;
}

}  // namespace luch::cpu

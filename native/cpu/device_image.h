// A tree of plain views as another device needs it: blocks of bytes, and where the pointers inside them lead.
// Blocks are borrowed: who fills the image keeps them alive as long as it is read.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "luch/platform.h"

namespace luch::cpu {

struct DeviceImage {
    struct Block {
        std::string name;
        const void* data;
        size_t bytes;
    };
    struct Link {
        u32 block;      // that holds the pointer
        size_t offset;  // of the pointer in it
        u32 target;     // block that it leads to
        size_t target_offset;
    };
    std::vector<Block> blocks;  // blocks[0]: the outermost view
    std::vector<Link> links;

    // Returns the block's number. An empty block is allowed: its pointers become null.
    u32 add(std::string name, const void* data, size_t bytes) {
        blocks.push_back({std::move(name), data, bytes});
        return u32(blocks.size() - 1);
    }
    // The pointer `field`, which lies inside block `from`, leads to `target`.
    void link(u32 from, const void* field, u32 target, size_t target_offset = 0) {
        size_t offset = size_t(static_cast<const char*>(field) - static_cast<const char*>(blocks[from].data));
        links.push_back({from, offset, target, target_offset});
    }
    // Both at once: an array behind a pointer of the block.
    template <class T>
    u32 add_array(std::string name, u32 from, T* const& field, size_t count) {
        u32 block = add(std::move(name), field, count * sizeof(T));
        link(from, &field, block);
        return block;
    }
};

}  // namespace luch::cpu

// What the threads of a block find out together.
#pragma once
#include "rays/structure.cuh"

namespace luch {

// The least key of a block of RAY_BLOCK threads, for every thread of it. Between two calls lies a barrier.
__device__ __forceinline__ u64 block_min(u64 key) {
    __shared__ u64 least[RAY_BLOCK / 32];
    for (int step = 16; step > 0; step >>= 1) {
        u64 other = __shfl_xor_sync(0xffffffffu, key, step);
        key = other < key ? other : key;
    }
    if (threadIdx.x % 32 == 0) least[threadIdx.x / 32] = key;
    __syncthreads();
    for (int warp = 0; warp < RAY_BLOCK / 32; ++warp) key = least[warp] < key ? least[warp] : key;
    return key;
}

}  // namespace luch

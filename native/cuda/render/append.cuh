// Appending to lists on the device.
#pragma once
#include "luch/platform.h"

namespace luch {

// A place at the end of a list, whose length is counted; which one is a matter of chance, and nothing depends on it. The
// threads of a warp that come here together count once, as additions to one address wait for each other, and get places
// side by side.
__device__ __forceinline__ u32 append_to(u32* count) {
    u32 together = __activemask(), lane = threadIdx.x % 32u;
    int first = lowest_bit(together);
    u32 place = 0;
    if (int(lane) == first) place = atomicAdd(count, u32(popcount(together)));
    return __shfl_sync(together, place, first) + u32(popcount(together & ((1u << lane) - 1u)));
}

}  // namespace luch

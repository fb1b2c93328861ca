// How the stages of the wavefront are launched: one thread an entry.
#pragma once
#include "luch/platform.h"

namespace luch {

inline constexpr int STAGE_BLOCK = 128;  // threads; luch/cuda/render.py launches as many

__device__ __forceinline__ u32 stage_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

}  // namespace luch

// How the stages of the wavefront are launched: one thread an entry.
#pragma once
#include "luch/platform.h"

namespace luch {

inline constexpr int STAGE_BLOCK = 128;  // threads; luch/cuda/render.py launches as many

__device__ __forceinline__ u32 stage_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

// A pointer that the compiler may take for one into global memory: without that it prepares for shared memory, too.
template <class T>
__device__ __forceinline__ T* in_global(T* p) {
#ifdef __CUDA_ARCH__
    __builtin_assume(__isGlobal(p));
#endif
    return p;
}

}  // namespace luch

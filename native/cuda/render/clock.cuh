// How long a thread works at one path, in clock cycles, where the Render Time pass is asked for; else nothing.
#pragma once
#include "luch/integrator/wavefront.h"

namespace luch {

__device__ __forceinline__ void add_ticks(const Wavefront& wave, WaveClock clock, u32 slot, u32 ticks) {
    atomicAdd(wave.ticks + u64(clock) * wave.slots + slot, ticks);
}

// From its making to its end.
struct StageTimer {
    const Wavefront& wave;
    WaveClock clock;
    u32 slot;
    long long began;

    __device__ __forceinline__ StageTimer(const Wavefront& of, WaveClock kernel, u32 path) : wave(of) {
        clock = kernel, slot = path, began = 0;
        if constexpr (plan::TIME) began = clock64();
    }
    __device__ __forceinline__ ~StageTimer() {
        if constexpr (plan::TIME) {
            if (wave.ticks) add_ticks(wave, clock, slot, static_cast<u32>(clock64() - began));
        }
    }
};

}  // namespace luch

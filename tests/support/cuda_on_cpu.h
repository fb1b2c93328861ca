// Runs a CUDA kernel's source on the CPU, for its logic: every thread of a block is a fiber, and one that comes to a
// barrier or to a warp's vote waits until the others have come too. One block after the other; no speed.
#pragma once
#include <ucontext.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#define __global__
#define __device__
#define __host__
#ifndef __shared__
#define __shared__ static
#endif
#define __forceinline__ inline
#define __launch_bounds__(...)
#define __noinline__
#define __grid_constant__

struct uint3_ {
    unsigned x, y, z;
};
struct float4 {
    float x, y, z, w;
};
struct uint4 {
    unsigned x, y, z, w;
};

#ifndef CUDA_ON_CPU_STACK
#define CUDA_ON_CPU_STACK (1 << 16)  // bytes a thread
#endif

namespace cuda_on_cpu {

enum class Wait { NO, BLOCK, WARP };
struct Fiber {
    ucontext_t context;
    std::unique_ptr<char[]> stack;
    bool done = false;
    Wait wait = Wait::NO;
    unsigned mask = 0;
    uint64_t value = 0, answers[32] = {};
    bool predicate = false;
};
inline std::vector<Fiber> fibers;
inline ucontext_t scheduler;
inline int current = 0;
inline uint3_ thread_index, block_index, block_size, grid_size;
inline std::function<void()> body;

inline void yield_until(Wait wait) {
    fibers[current].wait = wait;
    int me = current;
    swapcontext(&fibers[me].context, &scheduler);
}
inline int block_vote(bool predicate) {
    fibers[current].predicate = predicate;
    yield_until(Wait::BLOCK);
    return int(fibers[current].value);
}
// What every lane of the mask gave; a lane that has ended gives 0.
inline const uint64_t* warp_exchange(unsigned mask, uint64_t value) {
    Fiber& f = fibers[current];
    f.mask = mask;
    f.value = value;
    yield_until(Wait::WARP);
    return fibers[current].answers;
}
inline void start() {
    body();
    fibers[current].done = true;
    swapcontext(&fibers[current].context, &scheduler);
}
inline bool release_block() {
    int count = 0;
    for (Fiber& f : fibers) {
        if (f.done) continue;
        if (f.wait != Wait::BLOCK) return false;
        count += f.predicate;
    }
    for (Fiber& f : fibers) f.wait = Wait::NO, f.value = uint64_t(count);
    return true;
}
inline bool release_warp(int first) {
    bool any = false;
    for (int lane = 0; lane < 32; ++lane) {
        Fiber& f = fibers[first + lane];
        if (f.done || f.wait != Wait::WARP) continue;
        bool complete = f.mask >> lane & 1u;
        for (int k = 0; k < 32; ++k) {
            Fiber& g = fibers[first + k];
            if ((f.mask >> k & 1u) && !g.done && (g.wait != Wait::WARP || g.mask != f.mask)) complete = false;
        }
        if (!complete) continue;
        uint64_t values[32];
        for (int k = 0; k < 32; ++k)
            values[k] = (f.mask >> k & 1u) && !fibers[first + k].done ? fibers[first + k].value : 0;
        unsigned mask = f.mask;
        for (int k = 0; k < 32; ++k)
            if ((mask >> k & 1u) && !fibers[first + k].done) {
                std::memcpy(fibers[first + k].answers, values, sizeof values);
                fibers[first + k].wait = Wait::NO;
            }
        any = true;
    }
    return any;
}
inline void run_block(unsigned threads) {
    fibers.clear();
    fibers.resize(threads);
    constexpr size_t STACK = CUDA_ON_CPU_STACK;
    for (Fiber& f : fibers) {
        f.stack.reset(new char[STACK]);
        getcontext(&f.context);
        f.context.uc_stack.ss_sp = f.stack.get();
        f.context.uc_stack.ss_size = STACK;
        f.context.uc_link = nullptr;
        makecontext(&f.context, start, 0);
    }
    for (;;) {
        bool ran = false, left = false;
        for (unsigned i = 0; i < threads; ++i) {
            if (fibers[i].done) continue;
            left = true;
            if (fibers[i].wait != Wait::NO) continue;
            current = int(i);
            thread_index = {i, 0, 0};
            ran = true;
            swapcontext(&scheduler, &fibers[i].context);
        }
        if (!left) return;
        bool released = release_block();
        for (unsigned w = 0; w < threads; w += 32) released |= release_warp(int(w));
        if (!ran && !released) {
            std::fprintf(stderr, "cuda_on_cpu: the threads of a block wait for each other for ever\n");
            std::abort();
        }
    }
}
inline void launch(unsigned grid, unsigned block, std::function<void()> kernel) {
    body = std::move(kernel);
    block_size = {block, 1, 1};
    grid_size = {grid, 1, 1};
    for (unsigned b = 0; b < grid; ++b) {
        block_index = {b, 0, 0};
        run_block(block);
    }
}

}  // namespace cuda_on_cpu

#define threadIdx cuda_on_cpu::thread_index_now()
#define blockIdx cuda_on_cpu::block_index
#define blockDim cuda_on_cpu::block_size
#define gridDim cuda_on_cpu::grid_size
namespace cuda_on_cpu {
inline uint3_ thread_index_now() { return {unsigned(current), 0, 0}; }
}  // namespace cuda_on_cpu

template <class T>
T __ldg(const T* p) {
    return *p;
}
template <class T>
T __ldcg(const T* p) {
    return *p;
}
template <class T>
T atomicExch(T* p, T x) {
    T old = *p;
    *p = x;
    return old;
}
inline void __threadfence() {}
template <class T, class U>
T atomicAdd(T* p, U x) {
    T old = *p;
    *p += T(x);
    return old;
}
template <class T>
T atomicMin(T* p, T x) {
    T old = *p;
    if (x < old) *p = x;
    return old;
}
inline void __syncthreads() { cuda_on_cpu::block_vote(false); }
inline int __syncthreads_count(bool p) { return cuda_on_cpu::block_vote(p); }
inline int __syncthreads_or(bool p) { return cuda_on_cpu::block_vote(p) != 0; }
inline void __syncwarp(unsigned mask = ~0u) { cuda_on_cpu::warp_exchange(mask, 0); }
inline unsigned __ballot_sync(unsigned mask, bool p) {
    const uint64_t* all = cuda_on_cpu::warp_exchange(mask, p);
    unsigned out = 0;
    for (int k = 0; k < 32; ++k) out |= unsigned(all[k] != 0) << k;
    return out;
}
// Fibers run one after the other: who comes somewhere comes alone.
inline unsigned __activemask() { return 1u << threadIdx.x % 32; }
inline bool __any_sync(unsigned mask, bool p) { return __ballot_sync(mask, p) != 0; }
template <class T>
T __shfl_sync(unsigned mask, T x, int lane) {
    uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof x);
    bits = cuda_on_cpu::warp_exchange(mask, bits)[lane & 31];
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
template <class T>
T __shfl_xor_sync(unsigned mask, T x, int step) {
    return __shfl_sync(mask, x, int(threadIdx.x % 32) ^ step);
}
inline unsigned __reduce_min_sync(unsigned mask, unsigned x) {
    const uint64_t* all = cuda_on_cpu::warp_exchange(mask, x);
    unsigned least = ~0u;
    for (int k = 0; k < 32; ++k)
        if ((mask >> k & 1u) && unsigned(all[k]) < least) least = unsigned(all[k]);
    return least;
}
inline long long clock64() { return (long long)__builtin_ia32_rdtsc(); }  // of all fibers together
inline int __popc(unsigned x) { return __builtin_popcount(x); }
inline int __clz(int x) { return x ? __builtin_clz(unsigned(x)) : 32; }
inline int __ffs(int x) { return __builtin_ffs(x); }

// The one header that asks which compiler reads it. Everything else is plain C++20 that the C++
// compiler and NVRTC both accept: no standard header, no allocation, no exceptions, no statics.
#pragma once

#if defined(__CUDACC_RTC__) || defined(__CUDACC__)
#define LUCH_CUDA 1
#define LUCH_FN __host__ __device__ __forceinline__
#define LUCH_FN_SLOW __host__ __device__ __noinline__
#define LUCH_FN_APART __host__ __device__ __noinline__
#define LUCH_CONST __device__ constexpr
#define LUCH_KEEP_LOOP _Pragma("unroll 1")  // long bodies: compiling them many times takes longer than running them
#else
#define LUCH_CUDA 0
#define LUCH_FN inline __attribute__((always_inline))
#define LUCH_FN_SLOW inline
#define LUCH_FN_APART inline __attribute__((noinline))  // a loop over lanes, vectorised on its own
#define LUCH_CONST inline constexpr
#define LUCH_KEEP_LOOP
#endif

#if defined(__CUDACC_RTC__)  // knows CUDA's functions, not the builtins that nvcc takes from the C++ compiler
#define __builtin_huge_valf() __builtin_bit_cast(float, 0x7f800000u)
#define __builtin_fabsf fabsf
#define __builtin_copysignf copysignf
#define __builtin_sqrtf sqrtf
#define __builtin_sqrt sqrt
#define __builtin_floorf floorf
#define __builtin_ceilf ceilf
#define __builtin_truncf truncf
#endif

namespace luch {

using i8 = signed char;
using u8 = unsigned char;
using i16 = short;
using u16 = unsigned short;
using i32 = int;
using u32 = unsigned int;
using i64 = long long;
using u64 = unsigned long long;

inline constexpr float PI = 3.14159265358979323846f;
inline constexpr float INV_PI = 0.31830988618379067154f;
inline constexpr float TWO_PI = 6.28318530717958647692f;
inline constexpr float INFINITE_DISTANCE = __builtin_huge_valf();
inline constexpr u32 NONE = 0xffffffffu;  // "no index" in every index field

// Index of the lowest and of the highest set bit; x must not be 0. The number of set bits.
// fused: a b + c, rounded once. larger, smaller: a NaN in a gives b, which must not be NaN.
#if LUCH_CUDA
LUCH_FN int lowest_bit(u32 x) { return __ffs(static_cast<int>(x)) - 1; }
LUCH_FN int highest_bit(u32 x) { return 31 - __clz(static_cast<int>(x)); }
LUCH_FN int popcount(u32 x) { return __popc(x); }
LUCH_FN float fused(float a, float b, float c) { return __fmaf_rn(a, b, c); }
LUCH_FN float larger(float a, float b) { return fmaxf(a, b); }
LUCH_FN float smaller(float a, float b) { return fminf(a, b); }
#else
LUCH_FN int lowest_bit(u32 x) { return __builtin_ctz(x); }
LUCH_FN int highest_bit(u32 x) { return 31 - __builtin_clz(x); }
LUCH_FN int popcount(u32 x) { return __builtin_popcount(x); }
LUCH_FN float fused(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
LUCH_FN float larger(float a, float b) { return a > b ? a : b; }
LUCH_FN float smaller(float a, float b) { return a < b ? a : b; }
#endif

// Counts what is rare, where many threads may count at once.
#if defined(__CUDA_ARCH__)
LUCH_FN void count_one(u64* counter) { atomicAdd(counter, 1ull); }
#else
LUCH_FN void count_one(u64* counter) { ++*counter; }
#endif

LUCH_FN u32 float_bits(float x) { return __builtin_bit_cast(u32, x); }
LUCH_FN float bits_float(u32 x) { return __builtin_bit_cast(float, x); }

// 32768 + byte i of x, exactly: in one instruction on CUDA, where conversions are slow.
#if LUCH_CUDA
LUCH_FN float byte_above_32768(u32 x, u32 i) { return bits_float(__byte_perm(x, 0x47000000u, 0x7404u | i << 4)); }
#else
LUCH_FN float byte_above_32768(u32 x, u32 i) { return bits_float(0x47000000u | ((x >> (8 * i)) & 0xffu) << 8); }
#endif

}  // namespace luch

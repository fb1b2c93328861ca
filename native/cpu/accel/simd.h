// Four and eight lanes. GCC's and Clang's vector types compile for every processor (an eight-wide vector is
// two halves where there is no AVX); only what they cannot say well is spelled in intrinsics.
#pragma once
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#include "luch/platform.h"

// Wide vectors are passed to functions only where these are inlined: their calling convention does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace luch::cpu {

using f4 = float __attribute__((vector_size(16)));
using f8 = float __attribute__((vector_size(32)));
using d4 = double __attribute__((vector_size(32)));
using i8v = int __attribute__((vector_size(32)));

// Memory may hold any type (may_alias); it must be aligned for V.
template <class V>
LUCH_FN V load(const void* p) {
    using Aliasing __attribute__((may_alias)) = V;
    return *static_cast<const Aliasing*>(p);
}
template <class V>
LUCH_FN void store(void* p, V v) {
    using Aliasing __attribute__((may_alias)) = V;
    *static_cast<Aliasing*>(p) = v;
}
template <class V>
LUCH_FN V splat(decltype(V{}[0] + V{}[0]) x) {
    return V{} + x;
}
// As the processor's own min and max: a NaN on either side gives b.
template <class V>
LUCH_FN V min_of(V a, V b) {
    return a < b ? a : b;
}
template <class V>
LUCH_FN V max_of(V a, V b) {
    return a > b ? a : b;
}
#if defined(__AVX__)
template <>
LUCH_FN f8 min_of(f8 a, f8 b) {
    return _mm256_min_ps(a, b);
}
template <>
LUCH_FN f8 max_of(f8 a, f8 b) {
    return _mm256_max_ps(a, b);
}
template <>
LUCH_FN d4 min_of(d4 a, d4 b) {
    return _mm256_min_pd(a, b);
}
template <>
LUCH_FN d4 max_of(d4 a, d4 b) {
    return _mm256_max_pd(a, b);
}
#endif
#if defined(__SSE__)
template <>
LUCH_FN f4 min_of(f4 a, f4 b) {
    return _mm_min_ps(a, b);
}
template <>
LUCH_FN f4 max_of(f4 a, f4 b) {
    return _mm_max_ps(a, b);
}
#endif

// Bit i: a[i] <= b[i] (false on NaN).
LUCH_FN u32 mask_le(f8 a, f8 b) {
#if defined(__AVX512VL__)
    return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ);
#elif defined(__AVX__)
    return static_cast<u32>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)));
#else
    u32 mask = 0;
    for (int i = 0; i < 8; ++i) mask |= u32(a[i] <= b[i]) << i;
    return mask;
#endif
}
LUCH_FN u32 mask_le(f4 a, f4 b) {
#if defined(__AVX512VL__)
    return _mm_cmp_ps_mask(a, b, _CMP_LE_OQ);
#elif defined(__SSE__)
    return static_cast<u32>(_mm_movemask_ps(_mm_cmple_ps(a, b)));
#else
    u32 mask = 0;
    for (int i = 0; i < 4; ++i) mask |= u32(a[i] <= b[i]) << i;
    return mask;
#endif
}
LUCH_FN u32 mask_lt(f4 a, f4 b) {
#if defined(__AVX512VL__)
    return _mm_cmp_ps_mask(a, b, _CMP_LT_OQ);
#elif defined(__SSE__)
    return static_cast<u32>(_mm_movemask_ps(_mm_cmplt_ps(a, b)));
#else
    u32 mask = 0;
    for (int i = 0; i < 4; ++i) mask |= u32(a[i] < b[i]) << i;
    return mask;
#endif
}
LUCH_FN u32 mask_lt(d4 a, d4 b) {
#if defined(__AVX512VL__)
    return _mm256_cmp_pd_mask(a, b, _CMP_LT_OQ);
#elif defined(__AVX__)
    return static_cast<u32>(_mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_LT_OQ)));
#else
    u32 mask = 0;
    for (int i = 0; i < 4; ++i) mask |= u32(a[i] < b[i]) << i;
    return mask;
#endif
}

}  // namespace luch::cpu

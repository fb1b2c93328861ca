// Packs: one value per lane, several lanes at once. A function written over a lane type F serves a
// plain float (CUDA, where a thread is a lane) and a PackF (the CPU, one vector register) alike.
// Needed where a loop's length differs from lane to lane, which stops compilers from vectorising.
#pragma once
#include "luch/math/fn.h"

namespace luch {

#if LUCH_CUDA
#define LUCH_UNROLL _Pragma("unroll")
#else
#if defined(__SANITIZE_ADDRESS__)
#define LUCH_UNROLL  // built with -O1, which removes some loops before it would unroll them and warns of the hint
#else
#define LUCH_UNROLL _Pragma("GCC unroll 32")
#endif
#if defined(__AVX512F__)
inline constexpr int PACK_LANES = 16;
#elif defined(__AVX2__)
inline constexpr int PACK_LANES = 8;
#else
inline constexpr int PACK_LANES = 4;
#endif
typedef float PackF __attribute__((vector_size(PACK_LANES * sizeof(float))));
typedef i32 PackI __attribute__((vector_size(PACK_LANES * sizeof(i32))));
typedef u32 PackU __attribute__((vector_size(PACK_LANES * sizeof(u32))));
#endif

// The integer and mask types that go with a lane type.
template <class F>
struct LaneTypes;
template <>
struct LaneTypes<float> {
    using Int = i32;
    using Word = u32;
    using Mask = bool;
};
template <class F>
using IntOf = typename LaneTypes<F>::Int;
template <class F>
using WordOf = typename LaneTypes<F>::Word;
template <class F>
using MaskOf = typename LaneTypes<F>::Mask;

// The same value in every lane.
template <class F>
LUCH_FN F spread(float x) {
    return F{} + x;
}

LUCH_FN float select(bool m, float a, float b) { return m ? a : b; }
LUCH_FN i32 select(bool m, i32 a, i32 b) { return m ? a : b; }
LUCH_FN bool any_lane(bool m) { return m; }
LUCH_FN i32 lane_int(float x) { return i32(x); }  // towards zero; |x| < 2^31
LUCH_FN float lane_float(i32 x) { return float(x); }
LUCH_FN float lane_float(u32 x) { return float(x); }
LUCH_FN u32 lane_word(i32 x) { return u32(x); }
LUCH_FN i32 lane_signed(u32 x) { return i32(x); }
LUCH_FN u32 lane_bits(float x) { return float_bits(x); }
LUCH_FN float lane_from_bits(u32 x) { return bits_float(x); }
LUCH_FN float lane_floor(float x) { return floor_f(x); }
LUCH_FN float lane_ceil(float x) { return ceil_f(x); }
LUCH_FN float lane_abs(float x) { return abs_f(x); }
LUCH_FN float lane_sqrt(float x) { return sqrt_f(x); }
LUCH_FN float lane_pow(float x, float y) { return pow_f(x, y); }
LUCH_FN float lane_fmod(float x, float y) { return fmod_f(x, y); }
LUCH_FN float lane_sin(float x) { return sin_f(x); }
LUCH_FN float lane_cos(float x) { return cos_f(x); }
LUCH_FN float lane_exp(float x) { return exp_f(x); }
LUCH_FN float lane_acos(float x) { return acos_f(x); }
LUCH_FN float lane_atan2(float y, float x) { return atan2_f(y, x); }
LUCH_FN float largest_lane(float x) { return x; }
LUCH_FN float lane_min(float a, float b) { return min_f(a, b); }
LUCH_FN float lane_max(float a, float b) { return max_f(a, b); }

#if !LUCH_CUDA
template <>
struct LaneTypes<PackF> {
    using Int = PackI;
    using Word = PackU;
    using Mask = PackI;
};

// clang-format off
LUCH_FN PackF select(PackI m, PackF a, PackF b) { return m ? a : b; }
LUCH_FN PackI select(PackI m, PackI a, PackI b) { return m ? a : b; }
LUCH_FN bool any_lane(PackI m) { i32 r = 0; for (int k = 0; k < PACK_LANES; k++) r |= m[k]; return r != 0; }
LUCH_FN PackI lane_int(PackF x) { return __builtin_convertvector(x, PackI); }
LUCH_FN PackF lane_float(PackI x) { return __builtin_convertvector(x, PackF); }
LUCH_FN PackF lane_float(PackU x) { return __builtin_convertvector(x, PackF); }
LUCH_FN PackU lane_word(PackI x) { return PackU(x); }
LUCH_FN PackI lane_signed(PackU x) { return PackI(x); }
LUCH_FN PackU lane_bits(PackF x) { return PackU(x); }
LUCH_FN PackF lane_from_bits(PackU x) { return PackF(x); }
LUCH_FN PackF lane_floor(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = floor_f(x[k]); return r; }
LUCH_FN PackF lane_ceil(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = ceil_f(x[k]); return r; }
LUCH_FN PackF lane_abs(PackF x) { return PackF(PackU(x) & 0x7fffffffu); }
LUCH_FN PackF lane_sqrt(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = sqrt_f(x[k]); return r; }
LUCH_FN PackF lane_pow(PackF x, PackF y) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = pow_f(x[k], y[k]); return r; }
LUCH_FN PackF lane_fmod(PackF x, float y) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = fmod_f(x[k], y); return r; }
LUCH_FN PackF lane_sin(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = sin_f(x[k]); return r; }
LUCH_FN PackF lane_cos(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = cos_f(x[k]); return r; }
LUCH_FN PackF lane_exp(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = exp_f(x[k]); return r; }
LUCH_FN PackF lane_acos(PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = acos_f(x[k]); return r; }
LUCH_FN PackF lane_atan2(PackF y, PackF x) { PackF r{}; for (int k = 0; k < PACK_LANES; k++) r[k] = atan2_f(y[k], x[k]); return r; }
LUCH_FN float largest_lane(PackF x) { float r = x[0]; for (int k = 1; k < PACK_LANES; k++) r = max_f(x[k], r); return r; }
LUCH_FN PackF lane_min(PackF a, PackF b) { return a < b ? a : b; }
LUCH_FN PackF lane_max(PackF a, PackF b) { return a > b ? a : b; }
// clang-format on
#endif

template <class F>
LUCH_FN F lane_mix(F a, F b, F t) {
    return a + t * (b - a);
}
template <class F>
LUCH_FN F lane_clamp(F x, float lo, float hi) {
    return lane_min(lane_max(x, spread<F>(lo)), spread<F>(hi));
}
// x, or zero where x is not finite or too large for arithmetic on it to stay finite.
template <class F>
LUCH_FN F lane_tame(F x) {
    return select(lane_abs(x) < 1e18f, x, F{});
}

// A point of D coordinates.
template <class F, int D>
struct Coord {
    F x[D];
};
template <class F, int D>
LUCH_FN Coord<F, D> operator*(Coord<F, D> p, F s) {
    LUCH_UNROLL for (int d = 0; d < D; d++) p.x[d] = p.x[d] * s;
    return p;
}

}  // namespace luch

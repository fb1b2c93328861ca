// A ray against boxes whose planes are multiples of a power of two: what compressed wide trees compare.
//
// Distances are taken along the direction's dominant axis z, in the tree's own units: D = t |d_z|. A plane is
// p + (32768 + q) s, q an integer in 0..255, s = 2^e; then D = (q + 32768) A + B with A = s r, B = (p - o) r and r
// the reciprocal of the direction's slope: byte_above_32768() gives the first factor in one instruction.
//
// Rounding. A is exact. fl(p - o) and the fused product that makes B each err by EPS times |p - o| <= |plane - o| +
// 33023 s, the last sum by EPS |D|: together 3 EPS of the distance and 2 EPS 33023 s < s / 254. The builder moves
// every plane out by PLANE_MARGIN s = s / 128 before it rounds to the grid, outwards again; r carries the rest.
//
// The cone of math/bounds.h, 1: slope SHEAR_ERROR about the ray. r_near <= 1 / (|d| + slope) and r_far >= 1 / (|d| -
// slope), d with |d_z| = 1, are taken from one reciprocal: 1 - x <= 1 / (1 + x), and 1 / (1 - x) <= 1 + 4/3 x for
// x <= 1/4. An axis with |d| < 4 slope is as good as parallel: a hit strays from o there by at most 5 slope D, D <=
// reach, the root's farthest corner. Take r = 2 / slope for both planes: the near distance is then at most 10 D and
// the far one at least -10 D, so shifting them apart by 12 reach keeps every hit, and the widened slab is 6 slope reach.
//
// Wider boxes. A plane moved out by `extra` has its distance moved by extra r, the larger r for both: near and far shift
// apart by as much. The shift rounds with B and with the last sum: 2 EPS of it more.
//
// Overflow. Nodes wider than WIDEST have NaN for p: their children are always entered. In all others |plane - o| and
// |p - o| are alike once a product overflows, so that the infinite distance is right.
#pragma once
#include "luch/geometry/box.h"
#include "luch/geometry/ray.h"
#include "luch/math/bounds.h"

namespace luch {

inline constexpr float PLANE_BIAS = 32768.0f;
inline constexpr float WIDEST = 1e27f;  // extent of a node's box
inline constexpr u32 SMALLEST_STEP = 20;  // biased exponents: 2^-107, so that A is no denormal,
inline constexpr u32 LARGEST_STEP = 217;  // 2^90

// byte_above_32768 with its constant in a register whose value CUDA's compiler does not know: of two constants it would
// copy one anew for every byte.
inline constexpr u32 BYTE_BIAS = 0x47000000u;
#if LUCH_CUDA
LUCH_FN float byte_above_32768(u32 x, u32 i, u32 bias) { return bits_float(__byte_perm(x, bias, 0x7404u | i << 4)); }
#else
LUCH_FN float byte_above_32768(u32 x, u32 i, u32) { return byte_above_32768(x, i); }
#endif

// Of three numbers. On CUDA as integers, in one instruction since sm_90: a NaN is dropped or comes out, and if any number
// is negative, smallest gives a negative one.
#if LUCH_CUDA
LUCH_FN float largest_or_zero(float a, float b, float c) {
    return __int_as_float(__vimax3_s32_relu(__float_as_int(a), __float_as_int(b), __float_as_int(c)));
}
LUCH_FN float smallest(float a, float b, float c) {
    return __int_as_float(__vimin3_s32(__float_as_int(a), __float_as_int(b), __float_as_int(c)));
}
#else
LUCH_FN float largest_or_zero(float a, float b, float c) { return larger(c, larger(b, larger(a, 0.0f))); }
LUCH_FN float smallest(float a, float b, float c) { return smaller(a, smaller(b, smaller(c, INFINITE_DISTANCE))); }
#endif

struct WideRay {
    float origin[3];
    float near_rdir[3], far_rdir[3];  // signed
    float shift[3];  // by which near and far move apart: parallel axes only
    float scale;  // D of t = 1
    u32 octant;  // bit 2: x is negative, 1: y, 0: z
    u32 byte_bias;  // BYTE_BIAS
    // Never below the distance of a hit at t.
    LUCH_FN float upper(float t) const { return fused(t, scale * (1.0f + WIDE_HIT_ERROR), 1e-37f); }
    LUCH_FN bool negative(int axis) const { return octant >> (2 - axis) & 1u; }
};

// extra: by how much every box is to be wider (0 for none).
LUCH_FN WideRay make_wide_ray(const Ray& ray, const Box& root, float extra = 0.0f) {
    WideRay out;
    Vec3 extent = max_v(abs_v(root.lo - ray.origin), abs_v(root.hi - ray.origin));
    float reach = max_component(extent) + extra;
    out.scale = max_component(abs_v(ray.direction));
    out.octant = 0;
    out.byte_bias = BYTE_BIAS | float_bits(ray.t_max) >> 31;  // t_max > 0: no bit, but the compiler cannot tell
    for (int axis = 0; axis < 3; ++axis) {
        float slope = abs_f(ray.direction[axis]) / out.scale;
        float sign = copysign_f(1.0f, ray.direction[axis]);
        bool parallel = slope < 4.0f * SHEAR_ERROR;
        float reciprocal = 1.0f / (parallel ? 0.5f * SHEAR_ERROR : slope);
        float x = parallel ? 0.0f : SHEAR_ERROR * reciprocal;
        out.origin[axis] = ray.origin[axis];
        out.near_rdir[axis] = sign * (reciprocal * (1.0f - x) * (1.0f - WIDE_SLAB_ERROR));
        out.far_rdir[axis] = sign * (reciprocal * (1.0f + 1.34f * x) * (1.0f + WIDE_SLAB_ERROR));
        out.shift[axis] = parallel ? 12.0f * reach : 0.0f;
        if (extra > 0.0f) out.shift[axis] += extra * abs_f(out.far_rdir[axis]) * (1.0f + WIDE_SLAB_ERROR);
        out.octant |= (float_bits(ray.direction[axis]) >> 31) << (2 - axis);
    }
    return out;
}

// The three axes of one node's grid for one ray.
struct WidePlanes {
    float near_step[3], far_step[3], near_base[3], far_base[3];
};
LUCH_FN void prepare_axis(const WideRay& ray, int axis, float grid, u32 exponent, WidePlanes* out) {
    float step = bits_float(exponent << 23), from = grid - ray.origin[axis];
    out->near_step[axis] = step * ray.near_rdir[axis];
    out->far_step[axis] = step * ray.far_rdir[axis];
    out->near_base[axis] = fused(from, ray.near_rdir[axis], -ray.shift[axis]);
    out->far_base[axis] = fused(from, ray.far_rdir[axis], ray.shift[axis]);
}

}  // namespace luch

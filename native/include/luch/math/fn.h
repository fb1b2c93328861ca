// Elementary functions of our own, so that one definition serves both compilers bit for bit.
//
// Each is straight-line code of + - * / sqrt, floor and bit operations: loops over lanes vectorise
// (libm calls would not), and without contraction the CPU and CUDA round alike. Polynomials are least
// maximum relative error, found with their coefficients already rounded to single precision. Errors,
// measured against double by tests/native/test_math.py, are below 2.5 ulp where the comment says
// nothing else. NaN gives NaN; infinities give their limits.
#pragma once
#include "luch/math/vec.h"

namespace luch {

LUCH_FN float trunc_f(float x) { return __builtin_truncf(x); }
LUCH_FN float ceil_f(float x) { return __builtin_ceilf(x); }
LUCH_FN float round_f(float x) { return __builtin_floorf(x + 0.5f); }
LUCH_FN float fract_f(float x) { return x - __builtin_floorf(x); }

// The upper 12 bits of the significand: the product of two such numbers is exact.
LUCH_FN float upper_half(float x) { return bits_float(float_bits(x) & 0xfffff000u); }

// x * 2^n for whole n in [-252, 254], in two factors so that the ends of the range round once.
LUCH_FN float scale_by_power_of_2(float x, float n) {
    i32 whole = static_cast<i32>(n);
    i32 first = whole >> 1, second = whole - first;
    float a = bits_float(static_cast<u32>(first + 127) << 23);
    float b = bits_float(static_cast<u32>(second + 127) << 23);
    return x * a * b;
}

// ---- circle --------------------------------------------------------------------------------------

// x = n * pi/2 + r, |r| <= pi/4, to the last bit up to 1e5 (Cody and Waite: pi/2 in pieces of 12 bits, n
// in halves, so that every product is exact); r is held in range beyond, where x itself is coarser than
// a turn. Returns n modulo 4.
LUCH_FN u32 reduce_angle(float x, float* r) {
    float n = clamp_f(floor_f(x * 0.636619772f + 0.5f), -16777216.0f, 16777216.0f);
    float upper = trunc_f(n * 0.000244140625f) * 4096.0f;
    float lower = n - upper;
    float y = (x - upper * 1.5703125f) - lower * 1.5703125f;
    y = (y - upper * 4.837512969970703125e-4f) - lower * 4.837512969970703125e-4f;
    y = (y - upper * 7.549533620476723e-8f) - lower * 7.549533620476723e-8f;
    y = y - n * 2.563344e-12f;
    *r = clamp_f(y, -1.5f, 1.5f);
    return static_cast<u32>(static_cast<i32>(n)) & 3u;
}

LUCH_FN float sin_near_zero(float r) {
    float z = r * r;
    return r + r * z * (-0.16666654f + z * (0.008332095f + z * -0.0001950554f));
}

LUCH_FN float cos_near_zero(float r) {
    float z = r * r;
    return (1.0f - 0.5f * z) + z * z * (0.04166664f + z * (-0.001388713f + z * 2.4412086e-05f));
}

LUCH_FN void sincos_f(float x, float* sine, float* cosine) {
    float r;
    u32 n = reduce_angle(x, &r);
    float s = sin_near_zero(r), c = cos_near_zero(r);
    float unordered = x - x;  // 0, or NaN where x is not finite
    bool odd = (n & 1u) != 0u;
    float a = odd ? c : s, b = odd ? s : c;
    *sine = bits_float(float_bits(a) ^ ((n & 2u) << 30)) + unordered;
    *cosine = bits_float(float_bits(b) ^ (((n + 1u) & 2u) << 30)) + unordered;
}

LUCH_FN float sin_f(float x) {
    float s, c;
    sincos_f(x, &s, &c);
    return s;
}

LUCH_FN float cos_f(float x) {
    float s, c;
    sincos_f(x, &s, &c);
    return c;
}

// Below 4 ulp.
LUCH_FN float tan_f(float x) {
    float s, c;
    sincos_f(x, &s, &c);
    return s / c;
}

LUCH_FN float asin_polynomial(float x, float z) {
    return x + x * z * (0.16666755f + z * (0.0749519f + z * (0.045484144f + z * (0.024110187f + z * 0.042286307f))));
}

// Arguments outside [-1, 1] count as its ends; NaN counts as -1.
LUCH_FN float asin_f(float x) {
    x = clamp_f(x, -1.0f, 1.0f);
    float a = abs_f(x);
    bool steep = a > 0.5f;  // asin a = pi/2 - 2 asin sqrt((1-a)/2)
    float z = steep ? 0.5f * (1.0f - a) : a * a;
    float p = asin_polynomial(steep ? sqrt_f(z) : a, z);
    return copysign_f(steep ? 1.57079637f - (2.0f * p + 4.37113883e-8f) : p, x);  // pi/2 in two pieces
}

LUCH_FN float acos_f(float x) {
    x = clamp_f(x, -1.0f, 1.0f);
    float a = abs_f(x);
    bool steep = a > 0.5f;
    float z = steep ? 0.5f * (1.0f - a) : a * a;
    float p = asin_polynomial(steep ? sqrt_f(z) : a, z);
    float near_one = x < 0.0f ? 3.14159265359f - 2.0f * p : 2.0f * p;
    float flat = 1.57079637f - (copysign_f(p, x) + 4.37113883e-8f);
    return steep ? near_one : flat;
}

LUCH_FN float atan_near_zero(float t) {
    float z = t * t;
    return t + t * z * (-0.33333316f + z * (0.19998531f + z * (-0.1424447f + z * (0.10599825f + z * -0.060917895f))));
}

// Angle of (x, y), as C's atan2 in every quadrant and on its axes (signed zeros included).
LUCH_FN float atan2_f(float y, float x) {
    constexpr float tan_22 = 0.414213562f, tan_67 = 2.41421356f;  // of pi/8 and 3 pi/8
    float ax = abs_f(x), ay = abs_f(y);
    // An infinite coordinate outweighs every finite one; huge ones must not overflow when added.
    bool infinite = ax == INFINITE_DISTANCE || ay == INFINITE_DISTANCE, huge = ax > 1e38f || ay > 1e38f;
    float scale = huge ? 0.25f : 1.0f;
    ax = infinite ? (ax == INFINITE_DISTANCE ? 1.0f : 0.0f) : ax * scale;
    ay = infinite ? (ay == INFINITE_DISTANCE ? 1.0f : 0.0f) : ay * scale;
    // The angle is 0, pi/4 or pi/2 and a rest of at most pi/8.
    bool steep = ay > tan_67 * ax, diagonal = ay > tan_22 * ax;
    float num = steep ? -ax : (diagonal ? ay - ax : ay);
    float den = steep ? ay : (diagonal ? ay + ax : ax);
    float base = steep ? 1.57079637f : (diagonal ? 0.785398185f : 0.0f);
    float low = steep ? -4.37113883e-8f : (diagonal ? -2.18556941e-8f : 0.0f);  // what base rounds away
    float angle = base + (atan_near_zero(den > 0.0f ? num / den : 0.0f) + low);
    bool left = (float_bits(x) >> 31) != 0u;
    angle = left ? 3.14159274f - (angle + 8.74227766e-8f) : angle;
    bool unordered = x != x || y != y;
    return unordered ? x + y : copysign_f(angle, y);
}

LUCH_FN float atan_f(float x) { return atan2_f(x, 1.0f); }

// ---- exponentials --------------------------------------------------------------------------------

LUCH_FN float exp2_near_zero(float f) {
    return 1.0f +
           f * (0.6931472f +
                f * (0.24022648f + f * (0.055503596f + f * (0.009618504f + f * (0.0013391036f + f * 0.00015327806f)))));
}

LUCH_FN float exp2_f(float x) {
    float inside = clamp_f(x, -152.0f, 129.0f);
    float n = floor_f(inside + 0.5f);
    float y = scale_by_power_of_2(exp2_near_zero(inside - n), n);
    return x != x ? x : y;
}

LUCH_FN float exp_f(float x) {
    float inside = clamp_f(x, -105.0f, 89.0f);
    float n = floor_f(inside * 1.44269504f + 0.5f);
    float r = (inside - n * 0.693145752f) - n * 1.42860677e-6f;  // ln 2 in two pieces; the first product is exact
    float p = 0.49999994f + r * (0.16666521f + r * (0.04166829f + r * (0.008368704f + r * 0.0013818939f)));
    float y = scale_by_power_of_2(1.0f + (r + r * r * p), n);
    return x != x ? x : y;
}

// ---- hyperbolic functions ------------------------------------------------------------------------

// Of their own, not the library's: CUDA's flush denormals and round otherwise than a CPU's. Within 4 units in the
// last place; infinite where the true value is beyond floats, as the library's are.

// sinh x for |x| <= 1: the series up to x^11, whose next term is below half a unit.
LUCH_FN float sinh_small(float x) {
    float z = x * x;
    float p = 8.33333333e-3f + z * (1.98412698e-4f + z * (2.75573192e-6f + z * 2.50521084e-8f));
    return x + x * z * (0.166666667f + z * p);
}
// e^|x| / 2, as a product of roots so that it overflows no sooner than the functions.
LUCH_FN float half_exp(float x) {
    float root = exp_f(0.5f * abs_f(x));
    return (0.5f * root) * root;
}
LUCH_FN float sinh_f(float x) {
    float e = half_exp(x), far = e - 0.25f / e;
    return abs_f(x) <= 1.0f ? sinh_small(x) : (x < 0.0f ? -far : (x != x ? x : far));
}
LUCH_FN float cosh_f(float x) {
    float e = half_exp(x);
    return e + 0.25f / e;
}
LUCH_FN float tanh_f(float x) {
    float s = sinh_small(x), e = exp_f(2.0f * min_f(abs_f(x), 20.0f));
    float far = 1.0f - 2.0f / (e + 1.0f);
    return abs_f(x) <= 1.0f ? s / sqrt_f(1.0f + s * s) : (x < 0.0f ? -far : (x != x ? x : far));
}

// ---- logarithms ----------------------------------------------------------------------------------

// x = 2^exponent * (1 + f), 1 + f in [sqrt(1/2), sqrt 2), for positive finite x.
LUCH_FN float split_power_of_2(float x, float* f) {
    bool subnormal = x < 1.17549435e-38f;
    u32 bits = float_bits(subnormal ? x * 8388608.0f : x);  // unsigned: negative x may wrap, log_special answers
    i32 exponent = static_cast<i32>(bits - 0x3f3504f3u) >> 23;
    *f = bits_float(bits - static_cast<u32>(exponent) * 8388608u) - 1.0f;
    return static_cast<float>(exponent - (subnormal ? 23 : 0));
}

// f - log(1 + f), through s = f / (2 + f) as log(1 + f) = 2 artanh s.
LUCH_FN float log_remainder(float f) {
    float s = f / (2.0f + f), z = s * s, half_square = 0.5f * f * f;
    float rest = z * (0.66666776f + z * (0.39977568f + z * 0.2987146f));
    return half_square - s * (half_square + rest);
}

// The value of a logarithm where x is not positive and finite.
LUCH_FN float log_special(float x, float regular) {
    float y = x == INFINITE_DISTANCE ? x : regular;
    y = x == 0.0f ? -INFINITE_DISTANCE : y;
    return x >= 0.0f ? y : bits_float(0x7fc00000u);
}

LUCH_FN float log_f(float x) {
    float f;
    float e = split_power_of_2(x, &f);
    float w = log_remainder(f);
    return log_special(x, e * 0.693145752f - ((w - e * 1.42860677e-6f) - f));
}

LUCH_FN float log2_f(float x) {
    float f;
    float e = split_power_of_2(x, &f);
    float w = log_remainder(f);
    return log_special(x, e + (f + (f * 0.442695041f - w * 1.44269504f)));  // log2(e) = 1 + 0.4427
}

// ---- powers --------------------------------------------------------------------------------------

// log2 of a positive finite number as a sum of two floats, to about 2^-31 relative.
LUCH_FN float log2_in_two(float x, float* low) {
    float f;
    float e = split_power_of_2(x, &f);
    // s = f / (2 + f) in two pieces: the first of 12 bits, the second from the remainder.
    float g = 2.0f + f, g_upper = upper_half(g);
    float g_lower = (2.0f - g) + f + (g - g_upper);
    float inverse = 1.0f / g;
    float s_upper = upper_half(f * inverse);
    float s_lower = ((f - s_upper * g_upper) - s_upper * g_lower) * inverse;
    float s = s_upper + s_lower, z = s * s;
    float series = s * z * (0.9617967f + z * (0.5770789f + z * (0.41192147f + z * 0.33662468f)));
    // 2 / ln 2 = 2.884765625 + 6.24456757e-4.
    float main = s_upper * 2.884765625f;
    float rest = s_lower * 2.884765625f + (s * 6.24456757e-4f + series);
    float high = e + main;
    *low = (main - (high - e)) + rest;
    return high;
}

// C's pow in all its special cases: pow(x, 0) = 1, negative bases with whole exponents, signed zeros and
// infinities. Below 2.5 ulp wherever the result is a normal number.
LUCH_FN float pow_f(float x, float y) {
    float low, high = log2_in_two(abs_f(x), &low);
    // Beyond 2^33 every base but 1 has run out of range anyhow.
    float yc = clamp_f(y, -8589934592.0f, 8589934592.0f);
    float y_upper = upper_half(yc), high_upper = upper_half(high);
    float high_lower = (high - high_upper) + low;
    float product = y_upper * high_upper;  // exact
    float rest = y_upper * high_lower + (yc - y_upper) * (high + low);
    float n = floor_f(clamp_f(product + rest, -152.0f, 129.0f) + 0.5f);
    float power = scale_by_power_of_2(exp2_near_zero(clamp_f((product - n) + rest, -1.0f, 1.0f)), n);

    power = x == 0.0f ? (y > 0.0f ? 0.0f : INFINITE_DISTANCE) : power;
    power = abs_f(x) == INFINITE_DISTANCE ? (y > 0.0f ? INFINITE_DISTANCE : 0.0f) : power;
    float half = 0.5f * y;
    bool whole = floor_f(y) == y, odd = whole && floor_f(half) != half;
    u32 sign = odd ? float_bits(x) & 0x80000000u : 0u;
    power = bits_float(float_bits(power) | sign);
    bool undefined = (x < 0.0f && !whole && abs_f(x) != INFINITE_DISTANCE) || x != x || y != y;
    power = undefined ? bits_float(0x7fc00000u) : power;
    return (y == 0.0f || x == 1.0f) ? 1.0f : power;
}

// ---- remainder -----------------------------------------------------------------------------------

// x - q * y, exactly where the result is a float.
LUCH_FN float subtract_multiple(float x, float q, float y) {
    float qu = upper_half(q), yu = upper_half(y), ql = q - qu, yl = y - yu;
    float product = q * y;
    float error = ((qu * yu - product) + qu * yl + ql * yu) + ql * yl;
    return (x - product) - error;
}

// C's fmod: exact, with the sign of x, for quotients up to 2^44; 0 beyond. y = 0 gives NaN.
LUCH_FN float fmod_f(float x, float y) {
    float a = abs_f(x), b = abs_f(y);
    float r = subtract_multiple(a, trunc_f(a / b), b);
    r = subtract_multiple(r, trunc_f(r / b), b);  // what the rounding of a large quotient left
    r = r < 0.0f ? r + b : r;
    r = r >= b ? r - b : r;
    r = (r >= 0.0f && r < b) ? r : 0.0f;
    r = a < b ? a : r;  // also an infinite y
    bool undefined = b == 0.0f || x - x != 0.0f || y != y;
    return undefined ? bits_float(0x7fc00000u) : copysign_f(r, x);
}

}  // namespace luch

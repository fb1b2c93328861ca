// The Math node, one operation per mode. Domains are Blender's: what is undefined (a division by
// zero, the root of a negative number) gives 0, never NaN.
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/op.h"

namespace luch {

// A unary, binary or ternary float operation: arguments a, b, c.
#define LUCH_FLOAT_OP1(STRUCT, EXPRESSION)                                                    \
    struct STRUCT {                                                                           \
        static constexpr int inputs = 1, outputs = 1;                                         \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0];                                                                  \
            out[0] = (EXPRESSION);                                                            \
        }                                                                                     \
    }
#define LUCH_FLOAT_OP2(STRUCT, EXPRESSION)                                                    \
    struct STRUCT {                                                                           \
        static constexpr int inputs = 2, outputs = 1;                                         \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0], b = in[1];                                                       \
            out[0] = (EXPRESSION);                                                            \
        }                                                                                     \
    }
#define LUCH_FLOAT_OP3(STRUCT, EXPRESSION)                                                    \
    struct STRUCT {                                                                           \
        static constexpr int inputs = 3, outputs = 1;                                         \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0], b = in[1], c = in[2];                                            \
            out[0] = (EXPRESSION);                                                            \
        }                                                                                     \
    }

LUCH_FLOAT_OP2(OpMathAdd, a + b);
LUCH_FLOAT_OP2(OpMathSubtract, a - b);
LUCH_FLOAT_OP2(OpMathMultiply, a* b);
LUCH_FLOAT_OP2(OpMathDivide, safe_divide(a, b));
LUCH_FLOAT_OP3(OpMathMultiplyAdd, a* b + c);

// x^0 is 1 and 0^y is 0; a negative base needs a whole exponent.
LUCH_FN float blender_power(float x, float y) {
    if (y == 0.0f) return 1.0f;
    if (x == 0.0f || (x < 0.0f && y != trunc_f(y))) return 0.0f;
    return pow_f(x, y);
}
LUCH_FN float blender_log(float x, float base) {
    return x <= 0.0f || base <= 0.0f ? 0.0f : safe_divide(log_f(x), log_f(base));
}
LUCH_FLOAT_OP2(OpMathPower, blender_power(a, b));
LUCH_FLOAT_OP2(OpMathLogarithm, blender_log(a, b));
LUCH_FLOAT_OP1(OpMathSqrt, safe_sqrt(a));
LUCH_FLOAT_OP1(OpMathInverseSqrt, a > 0.0f ? 1.0f / sqrt_f(a) : 0.0f);
LUCH_FLOAT_OP1(OpMathAbsolute, abs_f(a));
LUCH_FLOAT_OP1(OpMathExponent, exp_f(a));

LUCH_FN float sign_f(float x) { return x == 0.0f ? 0.0f : (x < 0.0f ? -1.0f : 1.0f); }
// Smooth minimum with a cubic blend of width k.
LUCH_FN float smooth_min(float a, float b, float k) {
    float nearest = min_f(a, b);
    float h = k != 0.0f ? max_f(k - abs_f(a - b), 0.0f) / k : 0.0f;
    return nearest - h * h * h * k * (1.0f / 6.0f);
}
LUCH_FLOAT_OP2(OpMathMinimum, min_f(a, b));
LUCH_FLOAT_OP2(OpMathMaximum, max_f(a, b));
LUCH_FLOAT_OP2(OpMathLessThan, a < b ? 1.0f : 0.0f);
LUCH_FLOAT_OP2(OpMathGreaterThan, a > b ? 1.0f : 0.0f);
LUCH_FLOAT_OP1(OpMathSign, sign_f(a));
LUCH_FLOAT_OP3(OpMathCompare, a == b || abs_f(a - b) <= max_f(c, COMPARE_LEAST) ? 1.0f : 0.0f);
LUCH_FLOAT_OP3(OpMathSmoothMin, smooth_min(a, b, c));
LUCH_FLOAT_OP3(OpMathSmoothMax, -smooth_min(-a, -b, c));

LUCH_FN float wrap_f(float x, float hi, float lo) {
    float range = hi - lo;
    return range != 0.0f ? x - range * floor_f((x - lo) / range) : lo;
}
LUCH_FLOAT_OP1(OpMathRound, floor_f(a + 0.5f));
LUCH_FLOAT_OP1(OpMathFloor, floor_f(a));
LUCH_FLOAT_OP1(OpMathCeil, ceil_f(a));
LUCH_FLOAT_OP1(OpMathTrunc, trunc_f(a));
LUCH_FLOAT_OP1(OpMathFract, a - floor_f(a));
LUCH_FLOAT_OP2(OpMathModulo, b != 0.0f ? fmod_f(a, b) : 0.0f);
LUCH_FLOAT_OP2(OpMathFlooredModulo, b != 0.0f ? a - floor_f(a / b) * b : 0.0f);
LUCH_FLOAT_OP3(OpMathWrap, wrap_f(a, b, c));
LUCH_FLOAT_OP2(OpMathSnap, floor_f(safe_divide(a, b)) * b);
LUCH_FLOAT_OP2(OpMathPingPong, b != 0.0f ? abs_f(fract_f((a - b) / (b * 2.0f)) * b * 2.0f - b) : 0.0f);

LUCH_FLOAT_OP1(OpMathSine, sin_f(a));
LUCH_FLOAT_OP1(OpMathCosine, cos_f(a));
LUCH_FLOAT_OP1(OpMathTangent, tan_f(a));
LUCH_FLOAT_OP1(OpMathArcsine, asin_f(a));
LUCH_FLOAT_OP1(OpMathArccosine, acos_f(a));
LUCH_FLOAT_OP1(OpMathArctangent, atan_f(a));
LUCH_FLOAT_OP2(OpMathArctan2, a == 0.0f && b == 0.0f ? 0.0f : atan2_f(a, b));
LUCH_FLOAT_OP1(OpMathSinh, sinh_f(a));
LUCH_FLOAT_OP1(OpMathCosh, cosh_f(a));
LUCH_FLOAT_OP1(OpMathTanh, tanh_f(a));
LUCH_FLOAT_OP1(OpMathRadians, a*(PI / 180.0f));
LUCH_FLOAT_OP1(OpMathDegrees, a * (180.0f / PI));

// Clamp (a between b and c), a blend of a and b by c, and the use_clamp check box.
LUCH_FLOAT_OP3(OpMathClamp, clamp_f(a, b, c));
LUCH_FLOAT_OP3(OpMathMix, a * (1.0f - c) + b * c);
LUCH_FLOAT_OP1(OpMathSaturate, saturate_f(a));

}  // namespace luch

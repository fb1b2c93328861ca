// The Math node, one operation per mode. Domains are Blender's: what is undefined (a division by
// zero, the root of a negative number) gives 0, never NaN.
#pragma once
#include "luch/shade/op.h"

namespace luch {

// A unary, binary or ternary float operation: arguments a, b, c.
#define LUCH_FLOAT_OP1(STRUCT, EXPRESSION)                                                \
    struct STRUCT {                                                                       \
        static constexpr int inputs = 1, outputs = 1;                                     \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0];                                                              \
            out[0] = (EXPRESSION);                                                        \
        }                                                                                 \
    }
#define LUCH_FLOAT_OP2(STRUCT, EXPRESSION)                                                \
    struct STRUCT {                                                                       \
        static constexpr int inputs = 2, outputs = 1;                                     \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0], b = in[1];                                                   \
            out[0] = (EXPRESSION);                                                        \
        }                                                                                 \
    }
#define LUCH_FLOAT_OP3(STRUCT, EXPRESSION)                                                \
    struct STRUCT {                                                                       \
        static constexpr int inputs = 3, outputs = 1;                                     \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            float a = in[0], b = in[1], c = in[2];                                        \
            out[0] = (EXPRESSION);                                                        \
        }                                                                                 \
    }

LUCH_FLOAT_OP2(OpMathAdd, a + b);
LUCH_FLOAT_OP2(OpMathSubtract, a - b);
LUCH_FLOAT_OP2(OpMathMultiply, a* b);
LUCH_FLOAT_OP2(OpMathDivide, safe_divide(a, b));
LUCH_FLOAT_OP3(OpMathMultiplyAdd, a* b + c);

}  // namespace luch

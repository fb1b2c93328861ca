// Map Range: in = value, from min, from max, to min, to max (, steps); params[0] = 1 where an empty
// source range gives `to min` (the vector node) instead of 0 (the float node).
#pragma once
#include "luch/shade/op.h"

namespace luch {

// Where x lies between from and to, 0 on an empty range.
LUCH_FN float range_factor(const float* in) { return safe_divide(in[0] - in[1], in[2] - in[1]); }

LUCH_FN float range_result(const float* in, const u32* params, float factor) {
    float mapped = in[3] + factor * (in[4] - in[3]);
    return in[1] != in[2] ? mapped : (params[0] != 0 ? in[3] : 0.0f);
}

struct OpMapRangeLinear {
    static constexpr int inputs = 5, outputs = 1, params = 1;
    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        out[0] = range_result(in, params, range_factor(in));
    }
};

struct OpMapRangeStepped {
    static constexpr int inputs = 6, outputs = 1, params = 1;
    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        float steps = in[5];
        float factor = steps > 0.0f ? floor_f(range_factor(in) * (steps + 1.0f)) / steps : 0.0f;
        out[0] = range_result(in, params, factor);
    }
};

struct OpMapRangeSmoothstep {
    static constexpr int inputs = 5, outputs = 1, params = 1;
    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        float t = saturate_f(range_factor(in));
        out[0] = range_result(in, params, (3.0f - 2.0f * t) * (t * t));
    }
};

struct OpMapRangeSmootherstep {
    static constexpr int inputs = 5, outputs = 1, params = 1;
    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        float t = saturate_f(range_factor(in));
        out[0] = range_result(in, params, t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f));
    }
};

}  // namespace luch

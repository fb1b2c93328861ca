// Color Ramp and curve nodes: tables of evenly spaced samples, as Cycles has them.
#pragma once
#include "luch/shade/nodes/vector.h"
#include "luch/shade/scene_view.h"

namespace luch {

// Channel `channel` of a table of `size` rows at x in 0..1. Between rows it is linear (or, with
// `stepped`, the row before); outside it goes on straight with `extrapolate`, else it stays.
LUCH_FN float table_lookup(const float* table, int size, int channels, int channel, float x, bool stepped,
                           bool extrapolate) {
    float last = float(size - 1);
    float at = saturate_f(x) * last;  // NaN: 0
    int row = int(at);
    row = row < 0 ? 0 : (row > size - 1 ? size - 1 : row);
    int next = row + 1 > size - 1 ? size - 1 : row + 1;
    float t = stepped ? 0.0f : at - float(row);
    float inside = (1.0f - t) * table[row * channels + channel] + t * table[next * channels + channel];
    float first = table[channel], second = table[channels + channel];
    float end = table[(size - 1) * channels + channel], before = table[(size - 2) * channels + channel];
    float below = first + (first - second) * -x * last, above = end + (end - before) * (x - 1.0f) * last;
    return extrapolate && x < 0.0f ? below : (extrapolate && x > 1.0f ? above : inside);
}

struct OpColorRamp {  // in: factor; out: colour, alpha; params: table, size, stepped
    static constexpr int inputs = 1, outputs = 4, params = 3;
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        const float* table = table_of(c, params[0]);
        for (int k = 0; k < 4; k++) {
            out[k] = table_lookup(table, int(params[1]), 4, k, in[0], params[2] != 0, false);
        }
    }
};

// One channel of a curve; in: value, factor; params: table, size, channels, channel, extrapolate,
// and as floats the first sample's place and the last one's.
struct OpCurve {
    static constexpr int inputs = 2, outputs = 1, params = 7;
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        float first = bits_float(params[5]), last = bits_float(params[6]);
        float x = (in[0] - first) / (last - first);
        float bent = table_lookup(table_of(c, params[0]), int(params[1]), int(params[2]), int(params[3]), x, false,
                                  params[4] != 0);
        out[0] = (1.0f - in[1]) * in[0] + in[1] * bent;
    }
};

}  // namespace luch

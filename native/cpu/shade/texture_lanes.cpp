// The texture operations over packs of lanes, compiled here once: they are the longest to compile.
#include "luch/shade/textures/ops.h"

namespace luch {

template <class Op>
void LaneOp<Op>::eval_lanes(const OpContext&, const u32* params, const float* const* in, float* const* out, int count) {
    for (int first = 0; first < count; first += PACK_LANES) {
        PackF read[Op::inputs], written[Op::outputs];
        for (int k = 0; k < Op::inputs; k++) __builtin_memcpy(&read[k], in[k] + first, sizeof(PackF));
        Op::template run<PackF>(params, read, written);
        for (int k = 0; k < Op::outputs; k++) __builtin_memcpy(out[k] + first, &written[k], sizeof(PackF));
    }
}

template <class Op>
void ImageOp<Op>::eval_lanes(const OpContext& c, const u32* params, const float* const* in, float* const* out,
                             int count) {
    alignas(64) float encoded[3][SHADE_LANES];
    alignas(64) float is_srgb[SHADE_LANES];  // a float, not a bool: else the loop below does not vectorise
    bool srgb = false;
    OpContext context = c;
    for (int lane = 0; lane < count; lane++) {
        float read[Op::inputs];
        for (int k = 0; k < Op::inputs; k++) read[k] = in[k][lane];
        context.lane = lane;
        const EncodedTexel e = Op::find(context, params, read);
        encoded[0][lane] = e.texel.r;
        encoded[1][lane] = e.texel.g;
        encoded[2][lane] = e.texel.b;
        out[3][lane] = e.texel.a;
        is_srgb[lane] = e.srgb ? 1.0f : 0.0f;
        srgb |= e.srgb;
    }
    for (int k = 0; k < 3; k++) {
        float* __restrict color = out[k];
        if (srgb) {
            for (int lane = 0; lane < count; lane++) {
                const float linear = srgb_to_linear(encoded[k][lane]);
                color[lane] = is_srgb[lane] != 0.0f ? linear : encoded[k][lane];
            }
        } else {
            for (int lane = 0; lane < count; lane++) color[lane] = encoded[k][lane];
        }
    }
}

template void ImageOp<OpImage>::eval_lanes(const OpContext&, const u32*, const float* const*, float* const*, int);
template void ImageOp<OpImageBox>::eval_lanes(const OpContext&, const u32*, const float* const*, float* const*, int);
template void ImageOp<OpEnvironment>::eval_lanes(const OpContext&, const u32*, const float* const*, float* const*, int);

#define LUCH_OP(NAME, STRUCT) \
    template void LaneOp<STRUCT>::eval_lanes(const OpContext&, const u32*, const float* const*, float* const*, int);
#include "luch/shade/textures/lane_ops.inc"
#undef LUCH_OP

}  // namespace luch

// The texture operations over packs of lanes, compiled here once: they are the longest to compile.
#include "luch/shade/textures/ops.h"

namespace luch {

template <class Op>
void LaneOp<Op>::eval_lanes(const u32* params, const float* const* in, float* const* out, int count) {
    for (int first = 0; first < count; first += PACK_LANES) {
        PackF read[Op::inputs], written[Op::outputs];
        for (int k = 0; k < Op::inputs; k++) __builtin_memcpy(&read[k], in[k] + first, sizeof(PackF));
        Op::template run<PackF>(params, read, written);
        for (int k = 0; k < Op::outputs; k++) __builtin_memcpy(out[k] + first, &written[k], sizeof(PackF));
    }
}

#define LUCH_OP(NAME, STRUCT) \
    template void LaneOp<STRUCT>::eval_lanes(const u32*, const float* const*, float* const*, int);
#include "luch/shade/textures/lane_ops.inc"
#undef LUCH_OP

}  // namespace luch

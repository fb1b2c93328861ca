// What value operations over packs share: an operation states `run<F>(params, in, out)` once; `eval`
// (the contract of shade/op.h) runs it for one lane, `eval_lanes` for whole packs of them.
#pragma once
#include "luch/math/pack.h"
#include "luch/shade/op.h"

namespace luch {

template <class Op>
struct LaneOp {
    LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
        Op::template run<float>(params, in, out);
    }

#if !LUCH_CUDA
    // in, out: one array of SHADE_LANES floats per register. Lanes past count hold anything: they are
    // computed along and not looked at. An output array may be an input array.
    // Compiled once per operation, by cpu/shade/texture_lanes.cpp.
    static void eval_lanes(const OpContext&, const u32* params, const float* const* in, float* const* out, int count);
#endif
};

// Names of registers 0..2 of a vector input.
template <class F>
LUCH_FN Coord<F, 3> read_coord3(const F* in) {
    return {{in[0], in[1], in[2]}};
}

// The coordinates that a texture of D dimensions reads: (w), (x, y), (x, y, z) or (x, y, z, w).
template <class F, int D>
LUCH_FN Coord<F, D> texture_coord(const F* vector, F w, F scale) {
    Coord<F, D> p;
    if constexpr (D == 1) {
        p.x[0] = w * scale;
    } else {
        for (int d = 0; d < D; d++) p.x[d] = (d == 3 ? w : vector[d]) * scale;
    }
    return p;
}

}  // namespace luch

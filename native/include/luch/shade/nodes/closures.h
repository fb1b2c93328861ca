// Operations that end in a closure: in[0..2] is the weight, what follows are the closure's own inputs.
#pragma once
#include "luch/shade/op.h"

namespace luch {

// Radiance in W m^-2 sr^-1: weight alone (colour x strength x mix weights).
struct OpClosureEmission {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        c.closures->emission += make_vec3(in[0], in[1], in[2]);
    }
};

struct OpClosureTransparent {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        c.closures->transparent += make_vec3(in[0], in[1], in[2]);
    }
};

struct OpClosureHoldout {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        c.closures->holdout += average(make_vec3(in[0], in[1], in[2]));
    }
};

}  // namespace luch

// What a lobe answers when it is evaluated or sampled.
#pragma once
#include "luch/bsdf/closure.h"

namespace luch {

// One lobe's answer for a pair of directions: f |cos| without the lobe's weight, and its density.
struct LobeValue {
    Color f;
    float pdf_sa;  // 0: the lobe does not reach this direction
};

// One lobe's draw, before the other lobes are asked what they think of its direction.
struct LobeSample {
    Vec3 direction;
    Color f;       // as LobeValue; for a delta lobe the fraction of light that goes there
    float pdf_sa;  // for a delta lobe the probability; 0: no sample
    float roughness = 1.0f, eta = 1.0f;
    bool delta, transmitted;
};

LUCH_FN LobeValue no_value() { return {{0.0f, 0.0f, 0.0f}, 0.0f}; }

}  // namespace luch

// From matrices at evenly spaced times, as luch.scene has them, to the keys of luch/geometry/motion.h.
#pragma once
#include <array>
#include <vector>

#include "luch/geometry/motion.h"

namespace luch::cpu {

using Matrix = std::array<double, 12>;  // rows of a 3x4 affine

// One key a matrix, rotations on the short way from each to the next. A matrix that is not finite, or flat, gives none.
std::vector<TransformKey> make_keys(const std::vector<Matrix>& matrices);

// Inverts the shutter's curve: SHUTTER_ENTRIES + 1 times. curve: how far it is open at evenly spaced times, below 0
// counts as 0. Empty where the curve says nothing: all alike, or nowhere open.
std::vector<float> invert_shutter_curve(const std::vector<float>& curve);

}  // namespace luch::cpu

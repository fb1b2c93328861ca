// What pixels may be, told by neighbours that differ from them by no more than noise, and by what a pixel's samples
// agree upon: luch/accuracy.py says why.
#pragma once
#include "cpu/thread_pool.h"
#include "luch/math/vec.h"

namespace luch::cpu {

// A picture of height * width pixels, bottom row first.
struct NoisyPicture {
    i64 height, width;
    const float* mean;   // 3 a pixel
    const float* grey;   // of mean
    const float* held;   // what both parts of the samples bear out of grey
    const float* noise;  // variance of grey that a gap to a neighbour may have
    const u8* known;     // 0: says nothing of its neighbours
    const u8* beside;    // touches a surely brighter one
};

// Writes the guess from all neighbours up to radius, after those of radius - 1 and so on: guesses[r - 1] holds
// 3 * height * width floats. A pixel beside a brighter one that is more than edge_gap times its guess keeps its own.
void guess_truth(const NoisyPicture& picture, int radius, float edge_gap, float* const* guesses, ThreadPool& pool);

}  // namespace luch::cpu

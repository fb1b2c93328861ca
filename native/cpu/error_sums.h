// How far a picture is from the truth, told by the deviations of two parts of its samples: the sums that an estimate is
// made of. luch/accuracy.py says what they mean and has the constants.
#pragma once
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/math/vec.h"

namespace luch::cpu {

// A picture of height * width pixels, bottom row first, three channels.
struct NoisyPicture {
    i64 height, width;
    const float* mean;
    const float* deviation;  // half the difference of the parts, weighted as the film does; not finite: unknown
    double share;  // of the samples that the first part holds
};

// The constants of luch/accuracy.py, by their names there.
struct ErrorRules {
    double dark;
    i64 pool_radius, near, guide_radius;
    float sure, edge_gap, gap_variances;
    i64 tile;
    double fireflies;
};

struct ErrorSums {
    i64 pixels = 0;  // of which both parts are known
    std::vector<double>
        squares;  // of relative deviations, means of the channels, by guess at the truth: the nearest first
    double pooled = 0.0;  // squares of what near neighbours have on average, by the nearest guess
    double largest = 0.0;  // of the nearest guess's squares, the share of the pixels called fireflies
    double brightness = 0.0;  // means of the channels
    i64 tile_rows = 0, tile_columns = 0;
    std::vector<double> tiles;  // deviations, means of the channels, summed over tiles: row by row
};

// Writes the squares by each guess, guide_radius planes of height * width, the nearest guess first; 0 where nothing is
// known. The same bits with any number of threads.
void relative_squares(const NoisyPicture& picture, const ErrorRules& rules, double* const* out, ThreadPool& pool);

ErrorSums error_sums(const NoisyPicture& picture, const ErrorRules& rules, ThreadPool& pool);

}  // namespace luch::cpu

// Pixel filters, sampled by importance: every sample counts fully for one pixel, and where it falls
// around the pixel's centre follows the filter. All filters are separable and positive.
#pragma once
#include "luch/math/vec.h"

namespace luch {

inline constexpr int FILTER_CELLS = 1024;

struct PixelFilter {
    // Offset from the pixel's centre, in pixels, against its cumulative probability in equal steps.
    float offset[FILTER_CELLS + 1];
};

LUCH_FN float sample_filter(const PixelFilter& filter, float u) {
    float at = u * static_cast<float>(FILTER_CELLS);
    int cell = static_cast<int>(at);  // u < 1, so that cell + 1 is in the table
    return mix_f(filter.offset[cell], filter.offset[cell + 1], at - static_cast<float>(cell));
}

LUCH_FN Vec2 sample_filter(const PixelFilter& filter, Vec2 u) {
    return {sample_filter(filter, u.x), sample_filter(filter, u.y)};
}

}  // namespace luch

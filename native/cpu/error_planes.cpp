#include "cpu/error_planes.h"

#include <limits>

namespace luch::cpu {

Planes::Planes(const NoisyPicture& picture, const ErrorRules& rules, ThreadPool& pool)
    : height(picture.height), width(picture.width), picture_(picture), rules_(rules) {
    unit = largest_value(pool);
    for_rows(pool, [&](i64 y) { take_apart(y); });
    for_rows(pool, [&](i64 y) { add_along_row(y); });
    for_rows(pool, [&](i64 y) { judge(y); });
}

float Planes::largest_value(ThreadPool& pool) const {
    std::vector<float> rows(size_t(height), 0.0f);
    for_rows(pool, [&](i64 y) {
        float most = 0.0f;
        for (i64 pixel = y * width; pixel < (y + 1) * width; ++pixel)
            if (has_both_parts(pixel))
                for (int k = 0; k < 3; ++k) most = std::max(most, std::abs(picture_.mean[3 * pixel + k]));
        rows[size_t(y)] = most;
    });
    float most = rows.empty() ? 0.0f : *std::max_element(rows.begin(), rows.end());
    return std::max(most, std::numeric_limits<float>::min());
}

void Planes::take_apart(i64 y) {
    const double share = picture_.share, both = share * (1.0 - share);
    const double other_way = both > 0.0 ? (1.0 - 2.0 * share) / std::sqrt(both) : 0.0;
    for (i64 pixel = y * width; pixel < (y + 1) * width; ++pixel) {
        const size_t at = size_t(pixel);
        const bool there = has_both_parts(pixel);
        const float* d = picture_.deviation + 3 * pixel;
        known[at] = there ? 1.0f : 0.0f;
        for (int k = 0; k < 3; ++k) mean[k][at] = there ? picture_.mean[3 * pixel + k] / unit : 0.0f;
        grey[at] = (mean[0][at] + mean[1][at] + mean[2][at]) / 3.0f;
        const double scale = there ? 1.0 / (3.0 * unit) : 0.0;
        const double own = there ? (double(d[0]) + d[1] + d[2]) * scale : 0.0;
        const double magnitude =
            there ? (std::abs(double(d[0])) + std::abs(double(d[1])) + std::abs(double(d[2]))) * scale : 0.0;
        spread_[at] = own;
        sure[at] = float(magnitude) <= rules_.sure * grey[at] ? grey[at] : 0.0f;
        held[at] = borne_out(grey[at], own, other_way);
    }
}

void Planes::add_along_row(i64 y) {
    const float* light = row(grey, y);
    const double* deviations = spread_.data() + y * width;
    Row lit(size_t(width), 0.0), spread(size_t(width), 0.0);
    for (i64 x = 0; x < width; ++x) {
        lit[size_t(x)] = double(light[x]) * light[x];
        spread[size_t(x)] = deviations[x] * deviations[x];
    }
    double *to_lit = lit_along_.data() + y * width, *to_spread = spread_along_.data() + y * width;
    std::fill_n(to_lit, width, 0.0);
    std::fill_n(to_spread, width, 0.0);
    add_box(lit.data(), width, rules_.pool_radius, to_lit);
    add_box(spread.data(), width, rules_.pool_radius, to_spread);
}

void Planes::judge(i64 y) {
    Row lit(size_t(width), 0.0), spread(size_t(width), 0.0);
    for (i64 v = std::max<i64>(0, y - rules_.pool_radius); v <= std::min(height - 1, y + rules_.pool_radius); ++v) {
        const double *more = lit_along_.data() + v * width, *wider = spread_along_.data() + v * width;
        for (i64 x = 0; x < width; ++x) {
            lit[size_t(x)] += more[x];
            spread[size_t(x)] += wider[x];
        }
    }
    FloatRow brightest(size_t(width), 0.0f);
    for (i64 v = std::max<i64>(0, y - 1); v <= std::min(height - 1, y + 1); ++v)
        for (i64 dx = -1; dx <= 1; ++dx)
            if (v != y || dx != 0)
                for_neighbours(width, dx, [to = brightest.data(), from = row(sure, v), dx](i64 x) {
                    to[x] = std::max(to[x], from[x + dx]);
                });
    for (i64 x = 0; x < width; ++x) {
        const size_t at = size_t(y * width + x);
        const double relative = lit[size_t(x)] > 0.0 ? spread[size_t(x)] / lit[size_t(x)] : 0.0;
        noise[at] = float(rules_.gap_variances * relative) * grey[at] * grey[at];
        beside[at] = brightest[size_t(x)] >= grey[at] ? 1.0f : 0.0f;
    }
}

}  // namespace luch::cpu

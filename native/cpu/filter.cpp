#include "cpu/filter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace luch::cpu {
namespace {

constexpr double pi = 3.14159265358979323846;

// Filters over x = -1/2 .. 1/2 of their support.
double gaussian(double x) { return std::exp(-72.0 * x * x); }  // six deviations to either side

double blackman_harris(double x) {
    double a = 2.0 * pi * (x + 0.5);
    return 0.35875 - 0.48829 * std::cos(a) + 0.14128 * std::cos(2.0 * a) - 0.01168 * std::cos(3.0 * a);
}

}  // namespace

PixelFilter make_pixel_filter(const std::string& kind, double width) {
    PixelFilter filter{};
    double (*shape)(double);
    double support;
    // Blender's width is not the support: Gaussians are cut at three widths, Blackman-Harris at two.
    if (kind == "BOX") {
        for (int i = 0; i <= FILTER_CELLS; ++i) filter.offset[i] = static_cast<float>(i) / FILTER_CELLS - 0.5f;
        return filter;
    } else if (kind == "GAUSSIAN") {
        shape = gaussian;
        support = 3.0 * width;
    } else if (kind == "BLACKMAN_HARRIS") {
        shape = blackman_harris;
        support = 2.0 * width;
    } else {
        throw std::invalid_argument("Film: pixel filter \"" + kind +
                                    "\" is unknown. Use BOX, GAUSSIAN or BLACKMAN_HARRIS.");
    }
    constexpr int steps = 1 << 15;  // of the numerical integral
    std::vector<double> cumulative(steps + 1, 0.0);
    for (int i = 0; i < steps; ++i) cumulative[i + 1] = cumulative[i] + std::max(shape((i + 0.5) / steps - 0.5), 0.0);
    // Where on the support, -1/2 .. 1/2, the cumulative probability reaches `share`.
    int step = 0;
    auto invert = [&](double share) {
        double target = cumulative[steps] * share;
        while (step < steps - 1 && cumulative[step + 1] < target) ++step;
        double mass = cumulative[step + 1] - cumulative[step];
        double inside = mass > 0.0 ? std::clamp((target - cumulative[step]) / mass, 0.0, 1.0) : 0.5;
        return (step + inside) / steps - 0.5;
    };
    // The long thin tail lies in the outermost cells, where straight lines would widen it: their far
    // ends are moved so that the cells keep their mean.
    double tail_mean = 0.0;
    for (int i = 0; i < 64; ++i) tail_mean += invert((i + 0.5) / 64.0 / FILTER_CELLS) / 64.0;
    step = 0;
    for (int i = 0; i <= FILTER_CELLS; ++i)
        filter.offset[i] = static_cast<float>(support * invert(static_cast<double>(i) / FILTER_CELLS));
    float end = static_cast<float>(support * tail_mean * 2.0) - filter.offset[1];
    filter.offset[0] = end;
    filter.offset[FILTER_CELLS] = -end;
    return filter;
}

}  // namespace luch::cpu

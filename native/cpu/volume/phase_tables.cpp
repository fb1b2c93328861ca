#include "cpu/volume/phase_tables.h"

#include <algorithm>
#include <cmath>

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

constexpr double PI_D = 3.14159265358979323846;
// Half of the knots lie evenly over t = sin^2(angle / 2), the others by powers from PHASE_FIRST_KNOT on.

std::vector<double> knots() {
    constexpr int half = int(PHASE_KNOTS - 1) / 2;
    std::vector<double> t{0.0};
    for (int i = 0; i < half; ++i) t.push_back(PHASE_FIRST_KNOT * std::pow(1.0 / PHASE_FIRST_KNOT, double(i) / half));
    for (int i = 0; i < half; ++i) t.push_back((i + 1.0) / half);
    std::sort(t.begin(), t.end());
    return t;
}

// density(t): per steradian, up to a factor. The table is normalised as it stands, lines and all.
template <class Density>
std::vector<float> make_table(Density&& density) {
    const std::vector<double> t = knots();
    std::vector<float> table(3 * PHASE_KNOTS);
    double below = 0.0;
    std::vector<double> sums{0.0};
    for (u32 i = 0; i < PHASE_KNOTS; ++i) {
        table[i] = float(t[i]);
        table[PHASE_KNOTS + i] = float(std::max(density(std::max(t[i], PHASE_FIRST_KNOT)), 0.0));
        if (i == 0) continue;
        double width = double(table[i]) - double(table[i - 1]);
        below += 0.5 * width * (double(table[PHASE_KNOTS + i]) + double(table[PHASE_KNOTS + i - 1]));
        sums.push_back(below);
    }
    // dOmega = 4 pi dt.
    for (u32 i = 0; i < PHASE_KNOTS; ++i) {
        table[PHASE_KNOTS + i] = float(double(table[PHASE_KNOTS + i]) / (4.0 * PI_D * below));
        table[2 * PHASE_KNOTS + i] = float(sums[i] / below);
    }
    return table;
}

}  // namespace

std::vector<float> draine_table(double g, double alpha) {
    g = std::fabs(g);
    return make_table([&](double t) {
        double cosine = 1.0 - 2.0 * t, root = (1.0 - g) * (1.0 - g) + 4.0 * g * t;
        return (1.0 + alpha * cosine * cosine) / (root * std::sqrt(root));
    });
}

std::vector<float> fournier_forand_table(double refractive_index, double backscatter) {
    double n = std::clamp(refractive_index, 1.01, 2.0),
           b = std::clamp(backscatter, LEAST_BACKSCATTER, 0.5 - LEAST_BACKSCATTER);
    double scale = 4.0 / (3.0 * (n - 1.0) * (n - 1.0));  // delta = scale t
    double at_90 = 0.5 * scale, at_180 = scale;
    double v = -std::log(2.0 * b * (at_90 - 1.0) + 1.0) / std::log(at_90);
    double to_v = std::pow(at_180, v);
    double back = (1.0 - to_v) / (16.0 * PI_D * (at_180 - 1.0) * to_v);
    auto at = [&](double delta, double t) {
        double d = 1.0 - delta, power = std::pow(delta, v), e = 1.0 - power, cosine = 1.0 - 2.0 * t;
        double forward = (v * d - e + (delta * e - v * d) / t) / (4.0 * PI_D * d * d * power);
        return forward + back * (3.0 * cosine * cosine - 1.0);
    };
    return make_table([&](double t) {
        double delta = scale * t;
        // Numerator and denominator both vanish at delta = 1: taken from both sides.
        constexpr double before = 1.0 - FOURNIER_GAP, behind = 1.0 + FOURNIER_GAP;
        if (std::fabs(delta - 1.0) < FOURNIER_GAP)
            return 0.5 * (at(before, before / scale) + at(behind, behind / scale));
        return at(delta, t);
    });
}

}  // namespace luch::cpu

#include "cpu/motion/keys.h"

#include <algorithm>
#include <cmath>

#include "luch/camera/shutter.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

using Linear = std::array<double, 9>;

constexpr int POLAR_STEPS = 100;       // it converges quadratically; worse matrices are flat

// The transposed inverse; false for a flat matrix.
bool inverse_transposed(const Linear& a, Linear* out) {
    Linear c = {a[4] * a[8] - a[5] * a[7], a[5] * a[6] - a[3] * a[8], a[3] * a[7] - a[4] * a[6],
                a[2] * a[7] - a[1] * a[8], a[0] * a[8] - a[2] * a[6], a[1] * a[6] - a[0] * a[7],
                a[1] * a[5] - a[2] * a[4], a[2] * a[3] - a[0] * a[5], a[0] * a[4] - a[1] * a[3]};
    double determinant = a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
    if (determinant == 0.0 || !std::isfinite(determinant)) return false;
    for (size_t i = 0; i < 9; ++i) (*out)[i] = c[i] / determinant;
    return std::all_of(out->begin(), out->end(), [](double x) { return std::isfinite(x); });
}

double determinant_of(const Linear& a) {
    return a[0] * (a[4] * a[8] - a[5] * a[7]) + a[1] * (a[5] * a[6] - a[3] * a[8]) + a[2] * (a[3] * a[7] - a[4] * a[6]);
}

// The orthogonal factor of a matrix (Higham 1986): the mean of a matrix and its transposed inverse, again and again.
bool orthogonal_factor(const Linear& matrix, Linear* out) {
    Linear r = matrix, other;
    for (int step = 0; step < POLAR_STEPS; ++step) {
        if (!inverse_transposed(r, &other)) return false;
        double change = 0.0;
        for (size_t i = 0; i < 9; ++i) {
            double next = 0.5 * (r[i] + other[i]);
            change = std::max(change, std::abs(next - r[i]));
            r[i] = next;
        }
        if (change < POLAR_ENOUGH) break;
    }
    *out = r;
    return true;
}

// Of a rotation matrix (Shepperd 1978): the largest component first, so that nothing is divided by what is small.
std::array<double, 4> quaternion_of(const Linear& r) {
    double trace = r[0] + r[4] + r[8];
    std::array<double, 4> squared = {r[0] - r[4] - r[8], r[4] - r[0] - r[8], r[8] - r[0] - r[4], trace};
    size_t largest = size_t(std::max_element(squared.begin(), squared.end()) - squared.begin());
    double big = 0.5 * std::sqrt(1.0 + squared[largest]), scale = 0.25 / big;
    double a = (r[7] - r[5]) * scale, b = (r[2] - r[6]) * scale, c = (r[3] - r[1]) * scale;  // x w, y w, z w
    double xy = (r[1] + r[3]) * scale, xz = (r[2] + r[6]) * scale, yz = (r[5] + r[7]) * scale;
    if (largest == 0) return {big, xy, xz, a};
    if (largest == 1) return {xy, big, yz, b};
    if (largest == 2) return {xz, yz, big, c};
    return {a, b, c, big};
}

bool make_key(const Matrix& m, TransformKey* key) {
    if (!std::all_of(m.begin(), m.end(), [](double x) { return std::isfinite(x) && std::isfinite(float(x)); }))
        return false;
    Linear linear = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, r;
    if (!orthogonal_factor(linear, &r)) return false;
    // A mirror image is a rotation of what the stretch turns inside out.
    if (determinant_of(r) < 0.0)
        for (double& x : r) x = -x;
    std::array<double, 4> q = quaternion_of(r);
    for (size_t i = 0; i < 4; ++i) key->rotation[i] = float(q[i]);
    for (size_t row = 0; row < 3; ++row) {
        for (size_t column = 0; column < 3; ++column) {
            double sum = 0.0;
            for (size_t k = 0; k < 3; ++k) sum += r[3 * k + row] * linear[3 * k + column];
            key->stretch[3 * row + column] = float(sum);
        }
        key->place[row] = float(m[4 * row + 3]);
    }
    return true;
}

}  // namespace

std::vector<TransformKey> make_keys(const std::vector<Matrix>& matrices) {
    std::vector<TransformKey> keys(matrices.size());
    for (size_t i = 0; i < keys.size(); ++i) {
        if (!make_key(matrices[i], &keys[i])) return {};
        if (i == 0) continue;
        const float* before = keys[i - 1].rotation;
        float* q = keys[i].rotation;
        if (before[0] * q[0] + before[1] * q[1] + before[2] * q[2] + before[3] * q[3] < 0.0f)
            for (int k = 0; k < 4; ++k) q[k] = -q[k];
    }
    return keys;
}

std::vector<float> invert_shutter_curve(const std::vector<float>& curve) {
    size_t pieces = curve.size() > 1 ? curve.size() - 1 : 0;
    std::vector<double> open(pieces + 1), sum(pieces + 1);
    for (size_t i = 0; i <= pieces && pieces; ++i) open[i] = std::isfinite(curve[i]) ? std::max(0.0f, curve[i]) : 0.0;
    for (size_t i = 0; i < pieces; ++i) sum[i + 1] = sum[i] + 0.5 * (open[i] + open[i + 1]);
    bool even = std::all_of(open.begin(), open.end(), [&](double x) { return x == open[0]; });
    if (even || !(sum[pieces] > 0.0)) return {};
    std::vector<float> times(SHUTTER_ENTRIES + 1);
    size_t piece = 0;
    for (u32 i = 0; i <= SHUTTER_ENTRIES; ++i) {
        double wanted = sum[pieces] * double(i) / double(SHUTTER_ENTRIES);
        while (piece + 1 < pieces && sum[piece + 1] <= wanted && !(i == 0 && sum[piece + 1] > 0.0)) ++piece;
        // Within a piece the curve is a line: a quadratic equation for the place, in the form that loses no digits.
        double a = open[piece], slope = open[piece + 1] - a, rest = wanted - sum[piece];
        double root = std::sqrt(std::max(0.0, a * a + 2.0 * slope * rest));
        double share = a + root > 0.0 ? 2.0 * rest / (a + root) : 0.0;
        times[i] = float((double(piece) + std::clamp(share, 0.0, 1.0)) / double(pieces));
    }
    return times;
}

}  // namespace luch::cpu

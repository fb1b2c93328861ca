// A picture's rows taken apart for the sums of error_sums.h: what is told of each pixel by itself and its neighbours.
#pragma once
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "cpu/error_sums.h"

namespace luch::cpu {

inline constexpr size_t ROWS_AT_ONCE = 16;  // a thread's portion

using Row = std::vector<double>;
using FloatRow = std::vector<float>;

// A picture's worth of numbers, not set: the threads that fill it touch its memory first.
template <class T>
class PlaneOf {
 public:
    explicit PlaneOf(size_t size) : numbers_(new T[size]) {}
    T& operator[](size_t at) { return numbers_[at]; }
    const T& operator[](size_t at) const { return numbers_[at]; }
    T* data() { return numbers_.get(); }
    const T* data() const { return numbers_.get(); }

 private:
    std::unique_ptr<T[]> numbers_;
};
using Plane = PlaneOf<float>;

// Calls body(x) for the pixels of a row whose neighbour at x + dx is in it, too.
template <class Body>
void for_neighbours(i64 width, i64 dx, Body&& body) {
    const i64 first = std::max<i64>(0, -dx), last = std::min(width, width - dx);
#pragma GCC ivdep
    for (i64 x = first; x < last; ++x) body(x);
}
// Adds to each the sum of its neighbours in a row, up to radius away.
template <class T>
void add_box(const T* row, i64 width, i64 radius, double* to) {
    for (i64 dx = -radius; dx <= radius; ++dx) for_neighbours(width, dx, [=](i64 x) { to[x] += double(row[x + dx]); });
}

// A picture's rows taken apart, in units of its brightest value: squares of floats then stay floats.
class Planes {
 public:
    // picture and rules must outlive it.
    Planes(const NoisyPicture& picture, const ErrorRules& rules, ThreadPool& pool);

    template <class Body>
    void for_rows(ThreadPool& pool, Body&& body) const {
        pool.parallel_for(size_t(height), ROWS_AT_ONCE, [&](size_t begin, size_t end, unsigned) {
            for (i64 y = i64(begin); y < i64(end); ++y) body(y);
        });
    }

    bool is_known(i64 pixel) const { return known[size_t(pixel)] > 0.0f; }
    double deviation(i64 pixel, int k) const {
        return is_known(pixel) ? double(picture_.deviation[3 * pixel + k]) : 0.0;
    }
    const float* row(const Plane& plane, i64 y) const { return plane.data() + y * width; }

    const i64 height, width;
    const size_t size = size_t(height * width);
    float unit;
    Plane mean[3] = {Plane(size), Plane(size), Plane(size)};
    Plane grey{size};
    Plane held{size};    // what both parts of the samples bear out of grey
    Plane noise{size};   // variance of grey that a gap to a neighbour may have
    Plane known{size};   // 1; 0: says nothing of its neighbours
    Plane sure{size};    // grey where deviations tell that it is there, else 0
    Plane beside{size};  // 1: touches a surely brighter one, or one as bright

 private:
    float largest_value(ThreadPool& pool) const;
    bool has_both_parts(i64 pixel) const {
        const float* d = picture_.deviation + 3 * pixel;
        return std::isfinite(d[0]) && std::isfinite(d[1]) && std::isfinite(d[2]);
    }
    void take_apart(i64 y);
    // The harmonic mean of the pixel's two parts.
    static float borne_out(float grey, double d, double other_way) {
        const double other = grey + d * other_way;  // the two, weighted the other way round
        if (!(other > 0.0)) return 0.0f;
        return float(std::clamp(grey - d * d / other, 0.0, double(std::max(grey, 0.0f))));
    }
    // Squares of grey and of deviations, over the neighbours in the row.
    void add_along_row(i64 y);
    void judge(i64 y);
    const NoisyPicture& picture_;
    const ErrorRules& rules_;
    PlaneOf<double> spread_{size};  // deviations, means of the channels
    PlaneOf<double> lit_along_{size}, spread_along_{size};  // squares of grey and of those, over neighbours in the row
};

}  // namespace luch::cpu

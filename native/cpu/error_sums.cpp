#include "cpu/error_sums.h"

#include <cstdlib>
#include <functional>

#include "cpu/error_planes.h"

namespace luch::cpu {
namespace {

// One row's guesses at the truth: the mean of those neighbours whose brightness differs by no more than noise explains,
// and of what the pixel's own samples agree upon.
class RowGuess {
 public:
    RowGuess(const Planes& planes, const ErrorRules& rules)
        : planes_(planes), rules_(rules), bright_(size_t(planes.width)), count_(size_t(planes.width)) {
        for (FloatRow& sum : sum_) sum.resize(size_t(planes.width));
    }

    void begin(i64 y) {
        y_ = y;
        const float *grey = planes_.row(planes_.grey, y), *held = planes_.row(planes_.held, y);
        for (i64 x = 0; x < planes_.width; ++x) {
            const float part = grey[x] > 0.0f ? held[x] / grey[x] : 0.0f;
            bright_[size_t(x)] = 0.5f * (grey[x] + held[x]);
            count_[size_t(x)] = 1.0f;
            for (int k = 0; k < 3; ++k) sum_[k][size_t(x)] = part * planes_.row(planes_.mean[k], y)[x];
        }
    }
    // Adds the neighbours on the square of that radius.
    void add_ring(i64 radius) {
        for (i64 dy = -radius; dy <= radius; ++dy) {
            if (y_ + dy < 0 || y_ + dy >= planes_.height) continue;
            for (i64 dx = -radius; dx <= radius; ++dx)
                if (std::max(std::abs(dy), std::abs(dx)) == radius) add_neighbours(dy, dx);
        }
    }
    // Mean over the channels of squared relative deviations.
    void write_squares(double* out) const {
        const float* beside = planes_.row(planes_.beside, y_);
        for (i64 x = 0; x < planes_.width; ++x) {
            double square = 0.0;
            for (int k = 0; k < 3; ++k) {
                const float own = planes_.row(planes_.mean[k], y_)[x], guess = sum_[k][size_t(x)] / count_[size_t(x)];
                const float truth = beside[x] > 0.0f && own > rules_.edge_gap * guess ? own : guess;
                const double d = planes_.deviation(y_ * planes_.width + x, k);
                const double relative = d / (double(std::abs(truth)) * planes_.unit + rules_.dark);
                square += relative * relative;
            }
            out[x] = square / 3.0;
        }
    }

 private:
    void add_neighbours(i64 dy, i64 dx) {
        auto there = [&](const Plane& plane) { return planes_.row(plane, y_ + dy) + dx; };
        const float *noise = planes_.row(planes_.noise, y_), *bright = bright_.data();
        const float *grey = there(planes_.grey), *others = there(planes_.noise), *known = there(planes_.known);
        const float *red = there(planes_.mean[0]), *green = there(planes_.mean[1]), *blue = there(planes_.mean[2]);
        float *to_red = sum_[0].data(), *to_green = sum_[1].data(), *to_blue = sum_[2].data(), *count = count_.data();
        for_neighbours(planes_.width, dx, [=](i64 x) {
            const float gap = bright[x] - grey[x];
            const float counts = gap * gap <= noise[x] + others[x] ? known[x] : 0.0f;
            to_red[x] += counts * red[x];
            to_green[x] += counts * green[x];
            to_blue[x] += counts * blue[x];
            count[x] += counts;
        });
    }

    const Planes& planes_;
    const ErrorRules& rules_;
    i64 y_ = 0;
    FloatRow bright_, sum_[3], count_;
};

// Calls take(y, r, squares) for every row and guess, r = 0 the nearest.
template <class Take>
void each_row_of_squares(const Planes& planes, const ErrorRules& rules, ThreadPool& pool, Take&& take) {
    pool.parallel_for(size_t(planes.height), ROWS_AT_ONCE, [&](size_t begin, size_t end, unsigned) {
        RowGuess guess(planes, rules);
        Row squares(size_t(planes.width));
        for (i64 y = i64(begin); y < i64(end); ++y) {
            guess.begin(y);
            for (i64 radius = 1; radius <= rules.guide_radius; ++radius) {
                guess.add_ring(radius);
                guess.write_squares(squares.data());
                take(y, radius - 1, squares);
            }
        }
    });
}

double sum_of(const Row& values) {
    double sum = 0.0;
    for (double value : values) sum += value;
    return sum;
}

// Squares of what the neighbours of a row's pixels have on average.
double pooled_row(const Planes& planes, const PlaneOf<double>& squares, i64 near, i64 y) {
    const i64 width = planes.width;
    Row total(size_t(width), 0.0), known(size_t(width), 0.0);
    for (i64 v = std::max<i64>(0, y - near); v <= std::min(planes.height - 1, y + near); ++v) {
        add_box(squares.data() + v * width, width, near, total.data());
        add_box(planes.row(planes.known, v), width, near, known.data());
    }
    double sum = 0.0;
    for (i64 x = 0; x < width; ++x) {
        const double mean = planes.is_known(y * width + x) ? total[size_t(x)] / known[size_t(x)] : 0.0;
        sum += mean * mean;
    }
    return sum;
}

// The sum of the `count` largest.
double sum_of_largest(const double* values, size_t size, size_t count, ThreadPool& pool) {
    constexpr size_t PORTION = 1 << 17;
    const size_t portions = (size + PORTION - 1) / PORTION;
    std::vector<Row> found(portions);
    pool.parallel_for(portions, 1, [&](size_t begin, size_t, unsigned) {
        Row& own = found[begin];
        own.assign(values + begin * PORTION, values + std::min(size, (begin + 1) * PORTION));
        const size_t kept = std::min(count, own.size());
        std::nth_element(own.begin(), own.begin() + i64(kept - 1), own.end(), std::greater<>());
        own.resize(kept);
    });
    Row all;
    for (const auto& own : found) all.insert(all.end(), own.begin(), own.end());
    std::sort(all.begin(), all.end(), std::greater<>());
    all.resize(std::min(count, all.size()));
    return sum_of(all);
}

void add_up_tiles(const NoisyPicture& picture, const Planes& planes, const ErrorRules& rules, ThreadPool& pool,
                  ErrorSums* sums) {
    sums->tile_rows = (picture.height + rules.tile - 1) / rules.tile;
    sums->tile_columns = (picture.width + rules.tile - 1) / rules.tile;
    sums->tiles.assign(size_t(sums->tile_rows * sums->tile_columns), 0.0);
    pool.parallel_for(size_t(sums->tile_rows), 1, [&](size_t tile_row, size_t, unsigned) {
        for (i64 y = i64(tile_row) * rules.tile; y < std::min(picture.height, i64(tile_row + 1) * rules.tile); ++y) {
            for (i64 x = 0; x < picture.width; ++x) {
                const i64 pixel = y * picture.width + x;
                double sum = 0.0;
                for (int k = 0; k < 3; ++k) sum += planes.deviation(pixel, k);
                sums->tiles[tile_row * size_t(sums->tile_columns) + size_t(x / rules.tile)] += sum / 3.0;
            }
        }
    });
}

}  // namespace

void relative_squares(const NoisyPicture& picture, const ErrorRules& rules, double* const* out, ThreadPool& pool) {
    const Planes planes(picture, rules, pool);
    each_row_of_squares(planes, rules, pool, [&](i64 y, i64 guess, const Row& squares) {
        std::copy(squares.begin(), squares.end(), out[guess] + y * planes.width);
    });
}

ErrorSums error_sums(const NoisyPicture& picture, const ErrorRules& rules, ThreadPool& pool) {
    const Planes planes(picture, rules, pool);
    const size_t rows = size_t(planes.height);
    ErrorSums sums;
    PlaneOf<double> nearest(planes.size);
    Row pooled(rows), light(rows), known(rows);
    std::vector<Row> by_row(size_t(rules.guide_radius), Row(rows));
    each_row_of_squares(planes, rules, pool, [&](i64 y, i64 guess, const Row& squares) {
        by_row[size_t(guess)][size_t(y)] = sum_of(squares);
        if (guess == 0) std::copy(squares.begin(), squares.end(), nearest.data() + y * planes.width);
    });
    planes.for_rows(pool, [&](i64 y) {
        pooled[size_t(y)] = pooled_row(planes, nearest, rules.near, y);
        for (i64 pixel = y * planes.width; pixel < (y + 1) * planes.width; ++pixel) {
            if (!planes.is_known(pixel)) continue;
            known[size_t(y)] += 1.0;
            const float* mean = picture.mean + 3 * pixel;
            light[size_t(y)] += (double(mean[0]) + mean[1] + mean[2]) / 3.0;
        }
    });
    sums.pixels = i64(sum_of(known));
    if (sums.pixels == 0) return sums;
    for (const auto& guess : by_row) sums.squares.push_back(sum_of(guess));
    sums.pooled = sum_of(pooled);
    sums.brightness = sum_of(light);
    const auto fireflies = size_t(std::max(1.0, std::nearbyint(rules.fireflies * double(sums.pixels))));
    sums.largest = sum_of_largest(nearest.data(), planes.size, fireflies, pool);
    add_up_tiles(picture, planes, rules, pool, &sums);
    return sums;
}

}  // namespace luch::cpu

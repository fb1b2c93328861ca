#include "cpu/truth_guess.h"

#include <algorithm>
#include <cstdlib>

namespace luch::cpu {
namespace {

struct Gathered {
    float sum[3];
    float count;
};

// The pixel itself, as one among its neighbours, by what its samples agree upon.
Gathered own_part(const NoisyPicture& picture, i64 pixel) {
    const float grey = picture.grey[pixel], part = grey > 0.0f ? picture.held[pixel] / grey : 0.0f;
    const float* own = picture.mean + 3 * pixel;
    return {{part * own[0], part * own[1], part * own[2]}, 1.0f};
}

// Adds the neighbours on the square of that radius around a pixel, row by row.
void gather_ring(const NoisyPicture& picture, i64 y, i64 x, i64 radius, Gathered& to) {
    const i64 pixel = y * picture.width + x;
    const float brightness = 0.5f * (picture.grey[pixel] + picture.held[pixel]);
    for (i64 dy = -radius; dy <= radius; ++dy) {
        if (y + dy < 0 || y + dy >= picture.height) continue;
        for (i64 dx = -radius; dx <= radius; ++dx) {
            if (std::max(std::abs(dy), std::abs(dx)) != radius || x + dx < 0 || x + dx >= picture.width) continue;
            const i64 other = pixel + dy * picture.width + dx;
            const float gap = brightness - picture.grey[other];
            if (!picture.known[other] || !(gap * gap <= picture.noise[pixel] + picture.noise[other])) continue;
            for (int k = 0; k < 3; ++k) to.sum[k] += picture.mean[3 * other + k];
            to.count += 1.0f;
        }
    }
}

}  // namespace

void guess_truth(const NoisyPicture& picture, int radius, float edge_gap, float* const* guesses, ThreadPool& pool) {
    pool.parallel_for(size_t(picture.height), 8, [&](size_t begin, size_t end, unsigned) {
        for (i64 y = i64(begin); y < i64(end); ++y) {
            for (i64 x = 0; x < picture.width; ++x) {
                const i64 pixel = y * picture.width + x;
                Gathered near = own_part(picture, pixel);
                for (int r = 1; r <= radius; ++r) {
                    gather_ring(picture, y, x, r, near);
                    for (int k = 0; k < 3; ++k) {
                        const float own = picture.mean[3 * pixel + k];
                        const float guess = near.sum[k] / near.count;
                        guesses[r - 1][3 * pixel + k] = picture.beside[pixel] && own > edge_gap * guess ? own : guess;
                    }
                }
            }
        }
    });
}

}  // namespace luch::cpu

// What stands apart from the world, all that moves, as most rays see it: a box that they pass by. Many rays are asked at
// once, side by side in the processor's lanes, so that it costs a ray 2 ns and no misprediction.
#pragma once
#include "cpu/accel/simd.h"
#include "luch/accel/pass_by.h"

namespace luch::cpu {

inline constexpr u32 RAYS_ABREAST = 64;

// Rays by their numbers: origin, t_min, direction, t_max.
struct alignas(64) RaysAbreast {
    static_assert(sizeof(Ray) == 8 * sizeof(float));
    float rows[8][RAYS_ABREAST];

    void take(const Ray* rays, u32 count) {
        u32 i = 0;
        for (; i + 4 <= count; i += 4)
            for (u32 half = 0; half < 2; ++half) transpose(rays + i, half, i);
        for (; i < count; ++i)
            for (u32 row = 0; row < 8; ++row) __builtin_memcpy(&rows[row][i], row_of(rays + i, row), sizeof(float));
    }

 private:
    static const char* row_of(const Ray* ray, u32 row) {
        return reinterpret_cast<const char*>(ray) + sizeof(float) * row;
    }
    void transpose(const Ray* rays, u32 half, u32 at) {
        f4 a = load<f4>(row_of(rays, 4 * half)), b = load<f4>(row_of(rays + 1, 4 * half)),
           c = load<f4>(row_of(rays + 2, 4 * half)), d = load<f4>(row_of(rays + 3, 4 * half));
        f4 ab = __builtin_shufflevector(a, b, 0, 4, 1, 5), cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
        store(rows[4 * half] + at, __builtin_shufflevector(ab, cd, 0, 1, 4, 5));
        store(rows[4 * half + 1] + at, __builtin_shufflevector(ab, cd, 2, 3, 6, 7));
        ab = __builtin_shufflevector(a, b, 2, 6, 3, 7), cd = __builtin_shufflevector(c, d, 2, 6, 3, 7);
        store(rows[4 * half + 2] + at, __builtin_shufflevector(ab, cd, 0, 1, 4, 5));
        store(rows[4 * half + 3] + at, __builtin_shufflevector(ab, cd, 2, 3, 6, 7));
    }
};

// Writes those of `count` rays that may meet something of the box; returns how many. end(i): how far ray i goes.
template <class End>
u32 rays_towards(const PassBox& box, const Ray* rays, u32 count, u32* towards, End&& end) {
    RaysAbreast abreast;
    const auto& r = abreast.rows;
    u32 found = 0;
    for (u32 first = 0; first < count; first += RAYS_ABREAST) {
        const u32 size = count - first < RAYS_ABREAST ? count - first : RAYS_ABREAST;
        abreast.take(rays + first, size);
        alignas(64) float ends[RAYS_ABREAST];
        alignas(64) u32 near[RAYS_ABREAST];
        for (u32 i = 0; i < size; ++i) ends[i] = min_f(end(first + i), r[7][i]);
        for (u32 i = 0; i < size; ++i)
            near[i] = !passes_by(box, {r[0][i], r[1][i], r[2][i]}, {r[4][i], r[5][i], r[6][i]}, max_f(r[3][i], 0.0f),
                                 min_f(ends[i], LARGEST_DISTANCE));
        for (u32 i = 0; i < size; ++i) {
            towards[found] = first + i;
            found += near[i];
        }
    }
    return found;
}

}  // namespace luch::cpu

// Maps of photons: which samples each serves, and how photons are found in it. Filled by cpu/integrator/photon_map.cpp,
// on a GPU by luch/cuda/photons.py with the kernels of cuda/render/photons.cuh.
#pragma once
#include "luch/integrator/render_view.h"
#include "luch/sampling/hash.h"

namespace luch {

// -- which map serves a sample -----------------------------------------------------------------------

inline constexpr u32 MOST_SAMPLES_OF_MAP = 16;
// Radii shrink by samples^(-1/6): the variance of a mean over maps then falls as samples^(-2/3), its blur alike
// (Knaus and Zwicker's alpha of 2/3).
inline constexpr float RADIUS_EXPONENT = -1.0f / 6.0f;

// The map, of no samples, that tells how far to look for photons.
inline constexpr u32 PILOT_MAP = 0xfffffffeu;

// The first of the samples that share a map with this one. None lie on both sides of a power of two: the film parts
// samples there to tell the error, and both sides must not share photons.
LUCH_FN u32 first_of_map(u32 sample) {
    if (sample < 2u) return sample;
    u32 power = 1u << highest_bit(sample);
    return power < MOST_SAMPLES_OF_MAP ? power : sample - sample % MOST_SAMPLES_OF_MAP;
}

// How many samples from `sample` on, at most `count`, are served by its map.
LUCH_FN u32 samples_of_map(u32 sample, u32 count) {
    u32 first = first_of_map(sample);
    u32 size = first == 0u ? 1u : (first < MOST_SAMPLES_OF_MAP ? first : MOST_SAMPLES_OF_MAP);
    u32 left = first + size - sample;
    return left < count ? left : count;
}

// -- the map -----------------------------------------------------------------------------------------

struct PhotonCell {
    i32 x, y, z;
};

LUCH_FN i32 cell_along(float x, float inverse_cell) {
    return static_cast<i32>(clamp_f(floor_f(x * inverse_cell), -1e9f, 1e9f));
}
LUCH_FN PhotonCell cell_of(Vec3 p, float inverse_cell) {
    return {cell_along(p.x, inverse_cell), cell_along(p.y, inverse_cell), cell_along(p.z, inverse_cell)};
}
LUCH_FN u32 bucket_of(const PhotonCell& cell, u32 mask) {
    return hash_u32(static_cast<u32>(cell.x), static_cast<u32>(cell.y), static_cast<u32>(cell.z)) & mask;
}
inline constexpr u32 MOST_BUCKETS = 1u << 22;
// Photons stand in the order of their starts, so that no sum depends on which was there first.
LUCH_FN u64 photon_order(const Photon& photon) {
    return u64(photon.start) << 8 | u64(photon.bounce < 255u ? photon.bounce : 255u);
}

// Cells that a ball reaches into: two along an axis at most, as its diameter is a cell's width.
struct PhotonCells {
    PhotonCell low, high;
};
LUCH_FN PhotonCells cells_around(Vec3 p, float inverse_cell) {
    Vec3 around = make_vec3(0.5f / inverse_cell);
    return {cell_of(p - around, inverse_cell), cell_of(p + around, inverse_cell)};
}
// visit(cell) for each of them.
template <class Visit>
LUCH_FN void for_each_cell(const PhotonCells& cells, Visit&& visit) {
    for (i32 z = cells.low.z; z <= cells.high.z; ++z)
        for (i32 y = cells.low.y; y <= cells.high.y; ++y)
            for (i32 x = cells.low.x; x <= cells.high.x; ++x) visit(PhotonCell{x, y, z});
}

// The finest level at which photons are near enough to each other. Told by the pilot, not by the map: a choice by the
// very photons that are summed up would favour those places where chance has put too many.
LUCH_FN u32 level_at(const PhotonMap& map, Vec3 p) {
    u32 level = PHOTON_LEVELS - 1u;
    for (u32 finer = PHOTON_LEVELS; finer-- > 0u;) {
        const PhotonLevel& at = map.levels[finer];
        u32 expected = 0u;
        for_each_cell(cells_around(p, at.expected_inverse_cell),
                      [&](const PhotonCell& cell) { expected += at.expected[bucket_of(cell, at.expected_mask)]; });
        if (expected < map.enough) break;
        level = finer;
    }
    return level;
}

}  // namespace luch

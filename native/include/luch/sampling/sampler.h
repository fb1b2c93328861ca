// The families of points that paths draw their numbers from, a closed list, and which piece of a sequence a pixel takes.
//
// A dimension's two highest bits say its family, so that a path carries no word more for the choice; 0 is Sobol's. In all
// families sample_3d's x and y are sample_2d's.
#pragma once
#include "luch/plan.h"
#include "luch/sampling/independent.h"
#include "luch/sampling/lattice.h"
#include "luch/sampling/sobol.h"

namespace luch {

// In the order of luch/samplers.py.
enum class SamplerFamily : u32 { SOBOL, INDEPENDENT, LATTICE, COUNT };
static_assert(u32(SamplerFamily::COUNT) <= plan::ANY_SAMPLER);

inline constexpr u32 FAMILY_SHIFT = 30;
inline constexpr u32 FAMILY_BITS = 3u << FAMILY_SHIFT;

// To be added to every dimension of a render.
LUCH_FN u32 first_dimension(SamplerFamily family) { return static_cast<u32>(family) << FAMILY_SHIFT; }

// Kernels know their family when they are compiled.
LUCH_FN SamplerFamily family_of(u32 dimension) {
    return static_cast<SamplerFamily>(plan::SAMPLER == plan::ANY_SAMPLER ? dimension >> FAMILY_SHIFT : plan::SAMPLER);
}

template <SamplerFamily FAMILY>
LUCH_FN float sample_1d_of(const Sampler& s, u32 dimension) {
    if constexpr (FAMILY == SamplerFamily::INDEPENDENT) return independent_1d(s, dimension);
    if constexpr (FAMILY == SamplerFamily::LATTICE) return lattice_1d(s, dimension);
    return sobol_1d(s, dimension);
}

template <SamplerFamily FAMILY>
LUCH_FN Vec2 sample_2d_of(const Sampler& s, u32 dimension) {
    if constexpr (FAMILY == SamplerFamily::INDEPENDENT) return independent_2d(s, dimension);
    if constexpr (FAMILY == SamplerFamily::LATTICE) return lattice_2d(s, dimension);
    return sobol_2d(s, dimension);
}

template <SamplerFamily FAMILY>
LUCH_FN Vec3 sample_3d_of(const Sampler& s, u32 dimension) {
    if constexpr (FAMILY == SamplerFamily::INDEPENDENT) return independent_3d(s, dimension);
    if constexpr (FAMILY == SamplerFamily::LATTICE) return lattice_3d(s, dimension);
    return sobol_3d(s, dimension);
}

// Calls work with a FamilyTag of the family: loops over lanes are compiled for each, and ask once.
template <SamplerFamily FAMILY>
struct FamilyTag {
    static constexpr SamplerFamily VALUE = FAMILY;
};

template <typename Work>
LUCH_FN void with_family(SamplerFamily family, Work&& work) {
    switch (family) {
        case SamplerFamily::INDEPENDENT:
            return work(FamilyTag<SamplerFamily::INDEPENDENT>{});
        case SamplerFamily::LATTICE:
            return work(FamilyTag<SamplerFamily::LATTICE>{});
        default:
            return work(FamilyTag<SamplerFamily::SOBOL>{});
    }
}

// Apart, so that the default's calls stay as small as they are.
LUCH_FN_APART Vec3 sample_other(const Sampler& s, u32 dimension) {
    // x and y of three coordinates are those of two, and x is that of one.
    return family_of(dimension) == SamplerFamily::INDEPENDENT ? independent_3d(s, dimension) : lattice_3d(s, dimension);
}

LUCH_FN float sample_1d(const Sampler& s, u32 dimension) {
    if constexpr (plan::SAMPLER != plan::ANY_SAMPLER) return sample_1d_of<SamplerFamily(plan::SAMPLER)>(s, dimension);
    if (family_of(dimension) != SamplerFamily::SOBOL) return sample_other(s, dimension).x;
    return sobol_1d(s, dimension);
}

LUCH_FN Vec2 sample_2d(const Sampler& s, u32 dimension) {
    if constexpr (plan::SAMPLER != plan::ANY_SAMPLER) return sample_2d_of<SamplerFamily(plan::SAMPLER)>(s, dimension);
    if (family_of(dimension) != SamplerFamily::SOBOL) {
        Vec3 u = sample_other(s, dimension);
        return {u.x, u.y};
    }
    return sobol_2d(s, dimension);
}

LUCH_FN Vec3 sample_3d(const Sampler& s, u32 dimension) {
    if constexpr (plan::SAMPLER != plan::ANY_SAMPLER) return sample_3d_of<SamplerFamily(plan::SAMPLER)>(s, dimension);
    if (family_of(dimension) != SamplerFamily::SOBOL) return sample_other(s, dimension);
    return sobol_3d(s, dimension);
}

// Position of (x, y) on a Hilbert curve that fills a square of 2^levels pixels.
LUCH_FN u32 hilbert_index(u32 x, u32 y, u32 levels) {
    u32 d = 0;
    for (u32 level = levels; level-- > 0;) {
        u32 rx = (x >> level) & 1u, ry = (y >> level) & 1u;
        d = (d << 2) | ((3u * rx) ^ ry);
        u32 flip = (ry == 0u && rx == 1u) ? 0xffffffffu : 0u;
        u32 fx = x ^ flip, fy = y ^ flip;
        x = ry == 0u ? fy : fx;
        y = ry == 0u ? fx : fy;
    }
    return d;
}

// What of a pixel's sampler does not change from sample to sample.
struct PixelSampler {
    u32 seed, first_index;
};

// Neighbouring pixels take neighbouring pieces of one sequence (Ahmed and Wonka 2020): their errors
// then differ, and what noise is left looks fine-grained. log2_samples: the most samples the pixel
// will ever take, as a power of two; from 2^31 every pixel has a seed of its own instead. So has every pixel of a lattice:
// one that was moved alike for neighbours would make them err alike.
LUCH_FN PixelSampler make_pixel_sampler(u32 x, u32 y, u32 seed, u32 log2_samples, SamplerFamily family) {
    bool shares = log2_samples < 32u && family != SamplerFamily::LATTICE;
    u32 room = shares ? (32u - log2_samples) / 2u : 0u;
    u32 levels = room < 8u ? room : 8u;
    u32 mask = (1u << levels) - 1u;
    u32 tile_seed = hash_u32(seed, x >> levels, y >> levels);
    u32 piece = hilbert_index(x & mask, y & mask, levels);
    return {tile_seed, levels == 0u ? 0u : piece << log2_samples};
}

LUCH_FN Sampler make_sampler(const PixelSampler& pixel, u32 sample) { return {pixel.seed, pixel.first_index + sample}; }

}  // namespace luch

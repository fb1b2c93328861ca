// The rules of a path, one place for the CPU and CUDA: its state, when it ends, how bounces are counted,
// how strategies share the light. Bounce limits and pass rules follow Blender's.
#pragma once
#include "luch/bsdf/closure.h"
#include "luch/geometry/ray.h"
#include "luch/math/fn.h"
#include "luch/plan.h"
#include "luch/sampling/sampler.h"
#include "luch/shade/point.h"

namespace luch {

// What the integrator remembers of a path beside PathFlag (those are the low bits of the same word).
enum PathMemory : u32 {
    PATH_NO_MIS = 1u << 16,                  // camera ray or delta bounce: a light it finds counts in full
    PATH_THROUGH_FILM = 1u << 17,            // only transparency so far: the background may show as alpha
    PATH_LAST_BOUNCE = 1u << 18,             // a limit is reached: emission and transparency only
    PATH_ENDS_AT_SURFACE = 1u << 19,         // ends at the next surface, after its emission
    PATH_BEHIND_TRANSPARENT = 1u << 20,      // the last event was a pass through a transparent surface
    PATH_PASS_CHOSEN = 1u << 21,             // a bounce decided which light pass the rest belongs to
    PATH_DATA_DONE = 1u << 22,               // depth, normal and indices are written
    PATH_FEATURES = 1u << 23,                // denoising features are still to be written
    PATH_MIS_TRANSMITS = 1u << 24,           // the surface left last could be lit from behind
    PATH_VOLUME_PASS = 1u << 25,             // the bounce that chose its light pass was in a volume
    // With photon maps alone (integrator/caustics.h):
    PATH_AFTER_ROUGH = 1u << 26,             // it has been at a surface where photons are gathered
    PATH_CAUSTIC = 1u << 27,                 // and only by sharp bounces since: light it finds now photons bring
};

struct PathState {
    Color throughput;
    float continuation;       // Russian roulette probability of this segment, divided out at its end
    Vec3 mis_origin;          // where the last scattering happened
    float mis_pdf;            // of the direction it chose, per steradian
    Vec3 mis_normal;
    float min_pdf;            // smallest pdf so far (Filter Glossy)
    float footprint, spread;  // ray cone: radius at the ray's origin, growth per metre
    float travelled;          // from mis_origin to the ray's origin (transparent surfaces lie between)
    u32 flags;                // PathFlag | PathMemory
    u32 visibility;           // RayKind of the ray
    Sampler sampler;
    u32 dimension;            // of the next event's numbers; its two highest bits say the sampler's family
    u32 sample;               // of its pixel in this render, 0 the first
    u32 pixel;
    u16 bounce, transparent_bounce;
    u8 diffuse_bounce, glossy_bounce, transmission_bounce, volume_bounce;
    Color pass_diffuse, pass_glossy;  // shares of the first bounce in the light passes; the rest is transmission
    Color feature_throughput;
};

struct PathLimits {
    u32 bounces, diffuse, glossy, transmission, volume, transparent;
    u32 min_bounces, min_transparent;
    float clamp_direct, clamp_indirect;  // 0: off
    float filter_glossy;                 // 0: off
    bool caustics_reflective, caustics_refractive;
    bool film_transparent, film_transparent_glass;
    float film_transparent_roughness;
    float alpha_threshold;               // of data passes behind transparency
    float ao_distance;
};

// Dimensions of the sampler: the camera takes the first, every event of a path a block of its own.
inline constexpr u32 DIMENSIONS_CAMERA = 4;
enum CameraDimension : u32 { DIM_PIXEL, DIM_LENS };  // and time, with the place in the pixel
inline constexpr u32 DIMENSIONS_PER_EVENT = 4;
enum EventDimension : u32 { DIM_LIGHT, DIM_BSDF, DIM_TERMINATE, DIM_AO };

// Power heuristic (Veach 1995, exponent 2), without overflow for huge densities.
LUCH_FN float mis_weight(float pdf, float other_pdf) {
    if (!(other_pdf > 0.0f)) return 1.0f;
    float r = other_pdf / pdf;
    return 1.0f / (1.0f + r * r);
}

// Probability of going on. The square root ends paths late, as the eye sees brightness; division by
// the probability keeps the mean. Throughputs above 1 / LATENESS^2 are not put at risk: relMSE times seconds at 64
// samples, over that of a lateness of 1, was 0.86 (cornell_box) to 0.99 (bmw27) in eight scenes, 0.94 in the mean;
// of 2 it was 0.89 to 1.08.
inline constexpr float LATENESS = 1.5f;
LUCH_FN float continuation_probability(const PathState& path, const PathLimits& limits) {
    bool spared = (path.flags & PATH_BEHIND_TRANSPARENT) ? path.transparent_bounce <= limits.min_transparent
                                                         : path.bounce <= limits.min_bounces;
    if (spared) return 1.0f;
    return min_f(LATENESS * sqrt_f(max_component(abs_v(path.throughput))), 1.0f);
}

LUCH_FN void count_transparent(PathState& path, const PathLimits& limits) {
    path.transparent_bounce++;
    path.flags |= PATH_BEHIND_TRANSPARENT;
    if (path.transparent_bounce >= limits.transparent) path.flags |= PATH_ENDS_AT_SURFACE;
    path.dimension += DIMENSIONS_PER_EVENT;
}

// Which surfaces the next ray sees: a transmitted ray is neither diffuse nor glossy.
LUCH_FN u32 next_visibility(LobeClass lobe_class, bool transmitted) {
    if (transmitted) return RAY_TRANSMISSION;
    return lobe_class == CLASS_DIFFUSE ? RAY_DIFFUSE : RAY_GLOSSY;
}

// Counts a scattering event and sets the flags that Light Path, passes and limits ask for.
// transmits: the surface could be lit from behind. see_through: the film counts this refraction as
// transparent.
LUCH_FN void count_bounce(PathState& path, const PathLimits& limits, const BsdfSample& s, bool transmits,
                          bool see_through) {
    u32 flags =
        path.flags &
        ~(u32(PATH_CAMERA | PATH_DIFFUSE | PATH_GLOSSY | PATH_SINGULAR | PATH_REFLECT | PATH_TRANSMIT | PATH_VOLUME) |
          u32(PATH_NO_MIS | PATH_BEHIND_TRANSPARENT | PATH_MIS_TRANSMITS));
    path.bounce++;
    bool last = path.bounce >= limits.bounces;
    if (s.transmitted) {
        flags |= PATH_TRANSMIT;
        if (!see_through) flags &= ~u32(PATH_THROUGH_FILM);
        if (++path.transmission_bounce >= limits.transmission) last = true;
    } else {
        flags = (flags | PATH_REFLECT) & ~u32(PATH_THROUGH_FILM);
        if (s.lobe_class == CLASS_DIFFUSE) {
            if (++path.diffuse_bounce >= limits.diffuse) last = true;
        } else if (++path.glossy_bounce >= limits.glossy) {
            last = true;
        }
    }
    if (last) flags |= PATH_LAST_BOUNCE;
    if (s.lobe_class == CLASS_DIFFUSE) {
        flags |= PATH_DIFFUSE | PATH_DIFFUSE_ANCESTOR;
    } else {
        flags |= PATH_GLOSSY;
        if (s.delta) flags |= u32(PATH_SINGULAR) | u32(PATH_NO_MIS);
    }
    if (transmits) flags |= PATH_MIS_TRANSMITS;
    if (!(flags & PATH_THROUGH_FILM)) flags |= PATH_PASS_CHOSEN;
    path.flags = flags;
    path.visibility = next_visibility(s.lobe_class, s.transmitted);
    path.dimension += DIMENSIONS_PER_EVENT;
}

// Part of a whole, channel by channel; 0 of nothing.
LUCH_FN Color share(Color part, Color whole) {
    return {safe_divide(part.x, whole.x), safe_divide(part.y, whole.y), safe_divide(part.z, whole.z)};
}

// Scales a contribution whose brightness passes the limit; biased, off at 0.
LUCH_FN Color clamp_contribution(Color c, float limit) {
    float sum = abs_f(c.x) + abs_f(c.y) + abs_f(c.z);
    return (plan::CLAMPING && limit > 0.0f && sum > limit) ? c * (limit / sum) : c;
}

}  // namespace luch

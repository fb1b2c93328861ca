// The paths of a device under way at once, as structures of arrays, and the queues between its stages. Plain data:
// filled by the host (bindings/render.cpp makes it, luch/cuda/render.py sets the device's pointers), read by kernels.
#pragma once
#include "luch/integrator/volume.h"

namespace luch {

// Counters between stages, reset by the device itself.
enum WaveCounter : u32 {
    WAVE_RAYS,         // under way in this round
    WAVE_NEXT_RAYS,    // of the next round
    WAVE_SHADOWS,
    WAVE_HITS,         // rays that met a surface
    WAVE_TRACED,       // work counter of the closest kernel
    WAVE_TRACED_AFTER,  // and of the one for what moves, after it
    WAVE_NEAR_MOVERS,   // rays that are left for it
    WAVE_SHADOWED,     // the same of the shadow kernels
    WAVE_SHADOWED_AFTER,
    WAVE_SHADOWS_NEAR_MOVERS,
    WAVE_WALKS,        // under surfaces, of this round
    WAVE_WALKED,       // work counter of their kernel
    WAVE_SEE_THROUGH,  // shadow rays that met what may let light through
    WAVE_COUNTERS
};

// Statistics, sums over the whole render.
enum WaveTotal : u32 {
    TOTAL_SURFACE_POINTS,
    TOTAL_TRANSPARENT_STEPS,
    TOTAL_TRANSPARENT_RAYS,
    TOTAL_WORLD_POINTS,
    TOTAL_LIGHT_POINTS,
    TOTAL_WALKS,
    TOTAL_WALK_STEPS,
    TOTAL_FLIGHTS,
    TOTAL_CLAMPED,
    TOTAL_CUT,
    TOTAL_REFUSED,  // REFUSALS of them
    TOTALS = TOTAL_REFUSED + REFUSALS
};

// Kernels whose threads tell how long they worked, for the Render Time pass.
enum WaveClock : u32 {
    CLOCK_CLOSEST,
    CLOCK_ANY,
    CLOCK_MEDIA,
    CLOCK_LIGHT,
    CLOCK_SURFACES,
    CLOCK_WALKS,
    CLOCK_EXITS,
    CLOCK_SHADOWS,
    WAVE_CLOCKS
};

// 16 bytes of every path stand together, so that neighbouring threads read neighbouring memory.
struct alignas(16) PathWord {
    u32 w[4];
};
inline constexpr u32 PATH_WORDS = (sizeof(PathState) + sizeof(PathWord) - 1) / sizeof(PathWord);

struct SubsurfaceWalk;  // integrator/subsurface.h

// A slot holds one path. Slot = layer * layer_pixels + pixel within the wave: paths of one pixel that are under way
// together write to different layers of the film, so that no sum depends on who came first.
struct Wavefront {
    u32 slots, layer_pixels;
    u64 layer_stride;          // FilmSums from layer to layer
    u32 film_pixels;           // sample counts from layer to layer
    PathWord* paths;           // [word * slots + slot]
    Ray* rays;                 // compact: entry k belongs to slot ray_slot[k]
    u32* ray_slot;
    u32* ray_kind;
    Ray* next_rays;
    u32* next_slot;
    u32* next_kind;
    Hit* hits;                 // of rays
    u32* sorted;               // entries of rays that hit, grouped by material
    u32* material_first;       // per material: how many, then where its group begins, then its end
    Ray* shadow_rays;
    ShadowRay* shadows;
    u32* shadow_kind;          // RAY_SHADOW, all of them
    u8* blocked;
    u32* see_through;          // which shadow rays; null: nothing lets light through
    SubsurfaceWalk* walks;     // that begin in this round; null: nothing scatters under its surface
    MediumStack* media;        // by slot: around its ray; null: the scene has none
    MediumStack* shadow_media; // by shadow ray: around its beginning
    float* aovs;               // 4 floats for each of the film's AOVs, per entry of sorted; null: none
    u32* counters;             // WaveCounter
    u64* totals;               // WaveTotal
    float* ray_time;  // of rays, next_rays, shadow_rays: 0 to 1 while the shutter is open. Null: nothing moves
    float* next_time;
    float* shadow_time;
    u32* ticks;         // clock cycles, [WaveClock * slots + slot]. Null: the pass is not asked for
    u32* ray_ticks;     // of rays in the closest kernel
    u32* shadow_ticks;  // of shadow rays
    Photon* landed;     // photons of the map that is made, in no order. Null: the scene has none
    u32* landed_count;  // of them; may come to be more than there is room for
    u32 landed_room;
};

LUCH_FN float time_of_ray(const Wavefront& wave, u32 k) {
    return plan::MOTION && wave.ray_time ? wave.ray_time[k] : SHUTTER_MIDDLE;
}

struct RenderTask {
    RenderView scene;
    FilmView film;  // of layer 0
    Wavefront wave;
};

// One wave: pixels [first_pixel, first_pixel + pixel_count) of the film, or of a list, each with samples [first_sample,
// first_sample + sample_count), one layer each.
struct WaveRange {
    u32 first_pixel, pixel_count, first_sample, sample_count;
    const u32* pixels;  // no pixel twice; null: all of the film, in order
};

// Photons [first, first + count) of a map, which is told by its first sample.
struct PhotonRange {
    u32 map, first, count;
};

LUCH_FN PathState load_path(const Wavefront& wave, u32 slot) {
    union Both {
        PathWord words[PATH_WORDS];
        PathState path;
        LUCH_FN Both() : words{} {}
    } both;
    for (u32 i = 0; i < PATH_WORDS; ++i) both.words[i] = wave.paths[u64(i) * wave.slots + slot];
    return both.path;
}

LUCH_FN void store_path(const Wavefront& wave, u32 slot, const PathState& path) {
    union Both {
        PathWord words[PATH_WORDS];
        PathState path;
        LUCH_FN Both() : words{} {}
    } both;
    both.path = path;
    for (u32 i = 0; i < PATH_WORDS; ++i) wave.paths[u64(i) * wave.slots + slot] = both.words[i];
}

// Where a slot's path writes.
LUCH_FN FilmWriter film_of_slot(const RenderTask& task, u32 slot) {
    u32 layer = slot / task.wave.layer_pixels;
    FilmWriter writer{task.film, task.wave.totals + TOTAL_REFUSED};
    writer.film.rows += u64(layer) * task.wave.layer_stride;
    writer.film.sample_counts += u64(layer) * task.wave.film_pixels;
    return writer;
}

}  // namespace luch

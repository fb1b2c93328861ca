// Everything that a path reads while it is traced: one scene, ready to render, as plain data. Filled by
// cpu/integrator/renderer.cpp; nothing in it changes meanwhile.
#pragma once
#include "luch/camera/camera.h"
#include "luch/camera/shutter.h"
#include "luch/film/film.h"
#include "luch/film/filter.h"
#include "luch/integrator/medium.h"
#include "luch/integrator/path.h"
#include "luch/light/light.h"

namespace luch {

// Emission of a program that is the same everywhere, or everywhere on a side, evaluated once.
struct ConstantEmission {
    bool constant;
    Color radiance;
    bool by_side;
    Color behind;  // where the back face is seen
};

struct LocalTreesView;  // accel/local_trees.h

// A photon where it lies.
struct alignas(16) Photon {
    Vec3 point;      // world
    u32 start;       // the number of its path
    Vec3 normal;     // of the face, unit, on the side that it came to
    u32 lightgroup;
    Vec3 direction;  // unit, to where it came from
    u32 bounce;      // surfaces that threw it here
    Color power;     // W, of all starts of its map
    u32 unused;
};

// Where a photon is among those of its bucket: what a search reads.
struct alignas(16) PhotonPlace {
    Vec3 point;
    u32 photon;  // its number
};

// Photons by cells of a grid, those of a bucket together; several cells may share one. Levels differ in their radius.
struct PhotonLevel {
    const PhotonPlace* places;  // bucket by bucket
    const u32* first;     // [buckets + 1], into them
    const u16* expected;  // [expected buckets]: photons of a pilot, which tells how many there will be
    u32 mask, expected_mask;  // buckets - 1, a power of two less one
    float radius;         // that photons are gathered from, metres
    float inverse_cell;   // 1 / twice that
    float expected_inverse_cell;
    float scale;          // 1 / (starts * pi * radius^2)
};

// Each level's radius is twice that of the one before.
inline constexpr u32 PHOTON_LEVELS = 6;

struct PhotonMap {
    const Photon* photons;
    u32 count;
    u32 enough;  // photons of the pilot, in the cells around a point, for a level to be taken there
    PhotonLevel levels[PHOTON_LEVELS];
};

// Where photons begin: triangles whose material casts caustics, chosen by object, then by area.
struct CastersView {
    const u32* instances;
    const float* instance_cdf;   // [count + 1], for find_interval
    u32 count;
    const u32* object_first;     // [objects + 1]: its triangles among those below
    const u32* prims;
    const float* prim_cdf;       // object by object, one entry more than it has triangles
    float reach;                 // beyond everything that there is, metres: where light from infinity starts
};

struct RenderView {
    SceneView view;
    CameraView camera;
    const PixelFilter* filter;
    const ConstantEmission* material_emission;  // per material
    PathLimits limits;
    u32 seed;
    u32 first_sample;         // of this render: others may take those before
    u32 log2_samples;         // the sampler leaves this much room for each pixel
    SamplerFamily sampler;
    bool has_lens;            // paths choose a point of the aperture
    bool has_lights;          // anything that sample_light could choose
    bool has_visible_lamps;   // lamps of finite size that rays may meet
    bool has_world;           // one that is not black
    bool has_subsurface;      // some surface scatters light under itself
    const LocalTreesView* local_trees;  // on a device, of instances that do
    bool can_meet_light;      // a ray may come upon an emitter, a lamp or the world by itself
    u32 world_visibility, world_lightgroup;
    ConstantEmission world_emission;
    bool has_media;           // some volume or the world holds a medium: paths have lists of them
    MediaView media;
    float mist_start, mist_inverse_depth, mist_exponent;
    const ShutterView* shutter;  // null: nothing moves, and no path has a time
    bool photon_maps;         // photons bring what paths after rough surfaces find by sharp ones alone
    CastersView casters;
    PhotonMap photons;        // of the samples under way
};

LUCH_FN bool has_motion(const RenderView& scene) { return plan::MOTION && scene.shutter != nullptr; }

// Paths take notes for a denoiser until they meet something rough.
LUCH_FN bool wants_features(const FilmLayout& layout) {
    return plan::DENOISING_PASSES && (layout.denoising_albedo != NONE || layout.denoising_normal != NONE);
}

LUCH_FN bool wants_light_passes(const FilmLayout& layout) { return plan::LIGHT_PASSES && layout.any_light_pass; }
LUCH_FN bool wants_data_passes(const FilmLayout& layout) { return plan::DATA_PASSES && layout.any_data_pass; }
LUCH_FN bool gathers_features(const PathState& path) { return plan::DENOISING_PASSES && (path.flags & PATH_FEATURES); }

// Bounces as Light Path's nodes read them from ShadePoints::depth.
LUCH_FN u32 depth_word(const PathState& path) {
    u32 bounce = path.bounce < 255u ? path.bounce : 255u;
    return bounce | u32(path.diffuse_bounce) << 8 | u32(path.glossy_bounce) << 16 | u32(path.transmission_bounce) << 24;
}

// After its last bounce a path brings back nothing but light that it meets, unless the film or a denoiser's pass
// waits for what lies behind.
LUCH_FN bool looks_for_light_alone(const PathState& path) {
    constexpr u32 more = u32(PATH_FEATURES) | u32(PATH_THROUGH_FILM);
    return (path.flags & PATH_LAST_BOUNCE) && !(path.flags & more);
}

}  // namespace luch

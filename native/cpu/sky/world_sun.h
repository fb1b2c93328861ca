// The disc of the sun in a world's Sky Texture: too small for an importance map, so sampled on its own.
#pragma once
#include "luch/shade/scene_view.h"

namespace luch::cpu {

struct WorldSun {
    bool present = false;
    Vec3 direction{0.0f, 0.0f, 1.0f};  // unit, towards the sun
    float angle = 0.0f;                // diameter, radians
};

// The disc that the world's program shows (the largest, should there be several).
WorldSun find_world_sun(const SceneView& scene);

// d, or the direction beside the disc that is nearest to a d inside: what the sky shows there without it.
Vec3 beside_sun(const WorldSun& sun, Vec3 d);

// Mean radiance of the disc over the radiance of its centre (its limb is darker).
inline constexpr float SUN_MEAN_OVER_CENTRE = 0.8f;

}  // namespace luch::cpu

// What a shader program can ask about the point it shades. Structure of arrays: one chunk of
// SHADE_LANES points that share a program, so that each operation is one tight loop.
#pragma once
#include "luch/bsdf/path_flag.h"
#include "luch/math/vec.h"

namespace luch {

// 64 lanes: 64 float registers of 64 lanes are 16 KiB, half of a first-level cache.
inline constexpr int SHADE_LANES = LUCH_CUDA ? 1 : 64;

struct alignas(64) ShadePoints {
    int count;
    // Position, world (camera-relative) space; footprint of the ray there (see dP).
    float px[SHADE_LANES], py[SHADE_LANES], pz[SHADE_LANES];
    // Shading normal and geometric normal, unit, world, both flipped to the side of the ray.
    float nx[SHADE_LANES], ny[SHADE_LANES], nz[SHADE_LANES];
    float gx[SHADE_LANES], gy[SHADE_LANES], gz[SHADE_LANES];
    // Unit direction from the point towards where the ray came from.
    float ix[SHADE_LANES], iy[SHADE_LANES], iz[SHADE_LANES];
    float u[SHADE_LANES], v[SHADE_LANES];       // barycentrics, as in Hit
    float ray_length[SHADE_LANES];              // distance travelled by the last ray, metres
    float footprint[SHADE_LANES];               // radius of the ray's pixel cone at the point, metres
    // How far the surface that smooth normals speak of may reach out of the flat triangle along the normal, and the
    // other way, metres; the cosine of the light from which on shadow rays leave from there (0: never).
    float above[SHADE_LANES], below[SHADE_LANES], terminator[SHADE_LANES];
    u32 flags[SHADE_LANES];  // PathFlag
    u32 prim[SHADE_LANES], instance[SHADE_LANES];
    u32 depth[SHADE_LANES];  // bounces so far: total | diffuse<<8 | glossy<<16 | transmission<<24
    u32 transparent_depth[SHADE_LANES];
    u32 path[SHADE_LANES];  // caller's path index
    float time[SHADE_LANES];  // of the path, 0 to 1 while the shutter is open; set where anything moves
    u32 seed[SHADE_LANES];  // hash for stochastic nodes (none deterministic needs it)
    // For lamps and the world: the point is a direction; px..pz hold it, instance = NONE,
    // prim = light index for a lamp and NONE for the world.
};

}  // namespace luch

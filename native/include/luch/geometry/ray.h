// Rays and hits: what every structure, integrator and binding speaks.
#pragma once
#include "luch/math/vec.h"

namespace luch {

struct Ray {
    Vec3 origin;
    float t_min;
    Vec3 direction;  // need not be unit; t is in its units
    float t_max;     // hits lie in (t_min, t_max]
};

struct Hit {
    float t;       // INFINITE_DISTANCE on a miss
    u32 prim;      // triangle index within its mesh; NONE on a miss
    u32 instance;  // index into the scene's instances; NONE on a miss
    float u, v;    // barycentrics: point = (1-u-v) p0 + u p1 + v p2
};

// Which kinds of rays see an instance (Blender's Ray Visibility); a ray carries one or more bits.
enum RayKind : u32 {
    RAY_CAMERA = 1u,
    RAY_DIFFUSE = 2u,
    RAY_GLOSSY = 4u,
    RAY_TRANSMISSION = 8u,
    RAY_VOLUME = 16u,
    RAY_SHADOW = 32u,
    RAY_ALL = 63u,
};

}  // namespace luch

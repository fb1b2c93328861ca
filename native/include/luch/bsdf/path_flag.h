// Facts about a path that closures and the Light Path node ask for.
#pragma once
#include "luch/platform.h"

namespace luch {

enum PathFlag : u32 {
    PATH_CAMERA = 1u,
    PATH_SHADOW = 2u,
    PATH_DIFFUSE = 4u,
    PATH_GLOSSY = 8u,       // includes singular
    PATH_SINGULAR = 16u,    // the last bounce was a delta lobe
    PATH_REFLECT = 32u,
    PATH_TRANSMIT = 64u,    // the last bounce went through a surface (not transparent)
    PATH_VOLUME = 128u,
    PATH_EMISSION_ONLY = 256u,  // the program runs for its emission alone (light sampling)
    PATH_BACKFACING = 512u,     // the ray meets the surface from behind
    PATH_TRANSPARENT_ONLY = 1024u,  // the program runs for its transparency alone (shadow rays)
    PATH_DIFFUSE_ANCESTOR = 2048u,  // a diffuse bounce lies somewhere before (caustics switches)
};

}  // namespace luch

// The stages that run shader programs, in one module: what they call stands in it once.
#ifndef LUCH_TRANSPARENT
#define LUCH_TRANSPARENT 1  // some material lets light through
#endif
#ifndef LUCH_PLAN_CURVES
#define LUCH_PLAN_CURVES 1
#endif
#ifndef LUCH_STRUCTURE
#define LUCH_STRUCTURE Cwbvh  // and where it stands
#define LUCH_STRUCTURE_HEADER "luch/accel/cwbvh.h"
#endif
#include "render/exits.cuh"
#include "render/light.cuh"
#include "render/media.cuh"
#include "render/photons.cuh"
#include "render/shadow.cuh"
#include "render/surface.cuh"

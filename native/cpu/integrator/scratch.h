// Work space of one chunk: what lies between a stage's loops. Owned by a Batch, never allocated while tracing.
#pragma once
#include "cpu/integrator/batch.h"
#include "luch/geometry/surface.h"

namespace luch::cpu {

struct Batch::Scratch {
    ShadePoints points;        // the surface chunk
    ClosureSet sets[SHADE_LANES];
    SurfacePoint spawn[SHADE_LANES];
    ShadePoints light_points;  // emitters and the world
    ClosureSet light_sets[SHADE_LANES];
    LightSample samples[SHADE_LANES];
    Color emission[SHADE_LANES];
    int lit_lanes[SHADE_LANES];
    // Random numbers of the lit lanes, in their order: x, y and a choice.
    float light_u[3][SHADE_LANES], scatter_u[3][SHADE_LANES];
};

}  // namespace luch::cpu

// Work space of one chunk: what lies between a stage's loops. Owned by a Batch, never allocated while tracing.
#pragma once
#include "cpu/integrator/area_lamps.h"
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
    AreaLamps area_lamps;
    Color emission[SHADE_LANES];
    int lit_lanes[SHADE_LANES];
    // Random numbers of the lit lanes, in their order: x, y and a choice.
    float light_u[3][SHADE_LANES], scatter_u[3][SHADE_LANES];
};

struct Batch::OnePoint {
    Batch& batch;
    float time = SHUTTER_MIDDLE;  // of what it traces

    const ClosureSet& light(const Program& program, const ShadePoints& points) {
        run_program(batch.scene_.view, program, points, batch.scratch_->light_sets, batch.registers_.data(), nullptr, 0,
                    Wanted::LIGHT);
        return batch.scratch_->light_sets[0];
    }
    Hit closest(const Ray& ray) { return closest(ray, RAY_SHADOW); }
    Hit closest_of_all(const Ray& ray) { return closest(ray, RAY_ALL); }
    Hit closest(const Ray& ray, u32 kind) {
        Hit hit;
        batch.scene_.accel->closest(&ray, &kind, &hit, 1, batch.ray_time_.empty() ? nullptr : &time);
        return hit;
    }
};

}  // namespace luch::cpu

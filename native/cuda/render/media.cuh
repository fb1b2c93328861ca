// Stages between surfaces, in scenes with volumes alone: the media around the camera, and flights through media.
#pragma once
#include "luch/integrator/found_light.h"
#include "render/one_ray.cuh"
#include "render/stage.cuh"

#if LUCH_PLAN_VOLUMES

// After begin_paths.
extern "C" __global__ void __launch_bounds__(luch::STAGE_BLOCK, LUCH_STAGE_BLOCKS)
    enter_media(const __grid_constant__ luch::RenderTask task, const __grid_constant__ luch::SceneTrees trees) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = stage_index();
    if (k >= wave.counters[WAVE_RAYS]) return;
    OneRay tracer{trees, time_of_ray(wave, k)};
    wave.media[wave.ray_slot[k]] = media_at_lens(task.scene, wave.rays[k].origin, tracer);
}

// After trace_closest: lamps on the way, seen through media, and what the media do to the path.
LUCH_STAGE(cross_media) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = stage_index();
    if (k >= wave.counters[WAVE_RAYS]) return;
    u32 slot = wave.ray_slot[k];
    StageTimer timer(wave, CLOCK_MEDIA, slot);
    PathState path = load_path(wave, slot);
    const MediumStack stack = wave.media[slot];
    Ray ray = wave.rays[k];
    float reach = wave.hits[k].t, time = time_of_ray(wave, k);
    FilmWriter writer = film_of_slot(task, slot);
    ShadePoints points;
    ClosureSet set;
    PointShader shader{task.scene.view, set};
    if (plan::VISIBLE_LAMPS && task.scene.has_visible_lamps)
        find_lamps(task.scene, writer, path, ray, reach, &stack, shader, points);
    if (is_in_medium(task.scene.media, stack)) {
        const Flight flight = make_flight(task.scene.media, stack, path, reach);
        Ray next;
        ShadowRay shadow;
        if (may_scatter(path, flight) &&
            light_flight(task.scene, path, slot, stack, ray, flight, time, shader, points, &next, &shadow))
            push_shadow(wave, next, time, shadow, &stack);
        FlightEnd end = fly(task.scene, writer, path, stack, ray, flight, &next);
        if (end == FlightEnd::SCATTERED) push_ray(wave, next, time, slot, path.visibility);
        if (end != FlightEnd::AT_SURFACE) wave.hits[k].instance = NONE, wave.hits[k].prim = ENDED_IN_MEDIUM;
        store_path(wave, slot, path);
        add_total(wave, TOTAL_FLIGHTS, 1);
    }
    add_totals(wave, writer);
}

#endif

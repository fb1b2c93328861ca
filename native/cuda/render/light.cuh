// Stages at which a path meets light without a surface: lamps on its way, and what lies behind the scene.
#pragma once
#include "luch/integrator/found_light.h"
#include "render/stage.cuh"

LUCH_STAGE(find_light) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    u32 k = stage_index();
    if (k >= wave.counters[WAVE_RAYS]) return;
    if (plan::TIME && wave.ticks) add_ticks(wave, CLOCK_CLOSEST, wave.ray_slot[k], wave.ray_ticks[k]);
    bool missed = missed_all(wave.hits[k]);
    // Lamps that are seen through media: cross_media.
    bool lamps = plan::VISIBLE_LAMPS && task.scene.has_visible_lamps && !(plan::VOLUMES && wave.media);
    if (!missed && !lamps) return;
    u32 slot = wave.ray_slot[k];
    StageTimer timer(wave, CLOCK_LIGHT, slot);
    PathState path = load_path(wave, slot);
    Ray ray = wave.rays[k];
    FilmWriter writer = film_of_slot(task, slot);
    ShadePoints points;
    ClosureSet set;
    PointShader shader{task.scene.view, set};
    if (lamps) find_lamps(task.scene, writer, path, ray, wave.hits[k].t, nullptr, shader, points);
    if (missed && leave_scene(task.scene, writer, path, ray, shader, points)) {
        Color radiance = task.scene.world_emission.radiance;
        if (plan::WORLD_PROGRAM && !task.scene.world_emission.constant) {
            points.count = 1;
            setup_world_lane(path, ray.direction, points, 0);
            radiance = shader.light(task.scene.view.world_program, points).emission;
            add_total(wave, TOTAL_WORLD_POINTS, 1);
        }
        add_world(task.scene, writer, path, ray.direction, radiance);
    }
    add_totals(wave, writer);
}

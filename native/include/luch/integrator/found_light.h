// Light that a path finds by itself beside surfaces: lamps on its way, suns and the world where it leaves the scene.
#pragma once
#include "luch/integrator/accumulate.h"
#include "luch/integrator/caustics.h"
#include "luch/light/closest_lamp.h"
#include "luch/light/sample.h"

namespace luch {

// Colour of a lamp's node tree at the hit; white without one. shader.light as in walk_transparent.
template <class Shader>
LUCH_FN Color eval_lamp(const RenderView& scene, const PathState& path, const LampHit& hit, const Ray& ray,
                        Shader& shader, ShadePoints& points) {
    const LampView& lamp = scene.view.lights->lamps[hit.lamp];
    if (!plan::LAMP_PROGRAMS || !lamp.has_program) return make_vec3(1.0f);
    points.count = 1;
    LaneInputs in;
    in.point = finite_f(hit.t) ? ray.origin + ray.direction * hit.t : ray.direction;
    in.to_viewer = -ray.direction;
    in.instance = NONE, in.prim = hit.lamp;
    in.u = hit.u, in.v = hit.v;
    in.ray_length = finite_f(hit.t) ? hit.t + path.travelled : 0.0f;
    in.footprint = 0.0f;
    in.flags = (path.flags & 0xffffu) | PATH_EMISSION_ONLY;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    in.path = 0, in.seed = 0;
    in.time = SHUTTER_MIDDLE;  // lamps stand still
    setup_free_lane(in, hit.normal, points, 0);
    return shader.light(lamp.program, points).emission;
}

template <class Shader>
LUCH_FN void add_lamp(const RenderView& scene, FilmWriter& writer, const PathState& path, const LampHit& hit,
                      const Ray& ray, const MediumStack* stack, Shader& shader, ShadePoints& points) {
    float pdf = 0.0f;
    if (is_caustic(path) && pdf_lamp(scene.view, path.mis_origin, path.mis_normal, true, hit, ray.direction) > 0.0f)
        return;
    if (!(path.flags & PATH_NO_MIS)) {
        pdf =
            pdf_lamp(scene.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS, hit, ray.direction);
    }
    Color light = eval_lamp(scene, path, hit, ray, shader, points) * hit.radiance;
    if (plan::VOLUMES && stack) light *= media_transmittance(scene.media, *stack, hit.t);
    add_emission(scene, writer, path, light * mis_weight(path.mis_pdf, pdf), writer.film.layout.emission,
                 scene.view.lights->lamps[hit.lamp].lightgroup);
}

// Lamps do not stop rays: every lamp in front of the surface (at surface_t) adds its light. stack: media around the ray,
// or null.
template <class Shader>
LUCH_FN void find_lamps(const RenderView& scene, FilmWriter& writer, const PathState& path, Ray ray, float surface_t,
                        const MediumStack* stack, Shader& shader, ShadePoints& points) {
    ray.t_max = min_f(surface_t, ray.t_max);
    for (u32 passed = 0; passed < scene.limits.transparent + 1; passed++) {
        LampHit lamp = closest_lamp(scene.view, ray, path.visibility);
        if (lamp.lamp == NONE) break;
        add_lamp(scene, writer, path, lamp, ray, stack, shader, points);
        // Past this lamp: the next float after its distance.
        ray.t_min = bits_float(float_bits(max_f(lamp.t, 1e-30f)) + 1u);
        if (!(ray.t_min < ray.t_max)) break;
    }
}

// What a ray that leaves the scene does before the world's light; true when that light is wanted.
template <class Shader>
LUCH_FN bool leave_scene(const RenderView& scene, FilmWriter& writer, const PathState& path, const Ray& ray,
                         Shader& shader, ShadePoints& points) {
    // Suns with an angle.
    for (u32 sun = 0; plan::SUNS && sun < scene.view.lights->sun_count; sun++) {
        LampHit hit = sun_hit(scene.view, sun, ray.direction, path.visibility);
        if (hit.lamp != NONE) add_lamp(scene, writer, path, hit, ray, nullptr, shader, points);
    }
    bool data_open = (path.flags & PATH_THROUGH_FILM) && !(path.flags & PATH_DATA_DONE);
    if (data_open && path.sample == 0) film_set_background(writer, path.pixel);
    bool as_alpha = scene.limits.film_transparent && (path.flags & PATH_THROUGH_FILM);
    if (as_alpha) add_alpha_hole(writer, path, average(path.throughput));
    if (as_alpha && writer.film.layout.environment == NONE) return false;
    return scene.has_world && (scene.world_visibility & path.visibility);
}

// What the world's program reads in the direction of a ray.
LUCH_FN void setup_world_lane(const PathState& path, Vec3 direction, ShadePoints& points, int lane) {
    LaneInputs in{};
    in.point = direction;
    in.to_viewer = -direction;
    in.instance = in.prim = NONE;
    in.footprint = path.spread;
    in.flags = path.flags & 0xffffu;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    setup_free_lane(in, -direction, points, lane);
}

LUCH_FN void add_world(const RenderView& scene, FilmWriter& writer, const PathState& path, Vec3 direction,
                       Color radiance) {
    float pdf = 0.0f;
    if (is_caustic(path) && pdf_world(scene.view, path.mis_origin, path.mis_normal, true, direction) > 0.0f) return;
    if (!(path.flags & PATH_NO_MIS)) {
        pdf = pdf_world(scene.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS, direction);
    }
    Color light = radiance * mis_weight(path.mis_pdf, pdf);
    if (scene.limits.film_transparent && (path.flags & PATH_THROUGH_FILM)) {
        add_environment_only(scene, writer, path, light);
    } else {
        add_emission(scene, writer, path, light, writer.film.layout.environment, scene.world_lightgroup);
    }
}

}  // namespace luch

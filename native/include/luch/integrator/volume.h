// What happens to a path between two surfaces where the space is not empty: it is dimmed, gathers the medium's own
// light, is lit at some point, and may scatter there and go on elsewhere.
//
// Free flight: a channel is chosen by what the path still carries, a distance by that channel's extinction; the weight
// divides by the mean of all channels' densities (spectral multiple importance sampling), so that colours do not fight.
#pragma once
#include "luch/integrator/flight_light.h"
#include "luch/math/bounds.h"

namespace luch {

// A hit's prim, beside instance NONE, where a ray met no surface since its path scattered or ended before.
inline constexpr u32 ENDED_IN_MEDIUM = NONE - 1u;

LUCH_FN bool missed_all(const Hit& hit) {
    return hit.instance == NONE && !(plan::VOLUMES && hit.prim == ENDED_IN_MEDIUM);
}

// ---- the flight itself ---------------------------------------------------------------------------

LUCH_FN bool may_scatter(const PathState& path, const Flight& flight) {
    return !is_zero(flight.sum.scattering) && !(path.flags & (u32(PATH_LAST_BOUNCE) | u32(PATH_ENDS_AT_SURFACE)));
}

// Counts a scattering in a volume and sets the flags that Light Path, passes and limits ask for.
LUCH_FN void count_volume_bounce(PathState& path, const PathLimits& limits) {
    constexpr u32 cleared = u32(PATH_CAMERA) | PATH_DIFFUSE | PATH_GLOSSY | PATH_SINGULAR | PATH_REFLECT |
                            PATH_TRANSMIT | PATH_NO_MIS | PATH_BEHIND_TRANSPARENT | PATH_THROUGH_FILM;
    u32 flags = (path.flags & ~cleared) | u32(PATH_VOLUME) | u32(PATH_MIS_TRANSMITS);
    path.bounce++;
    if (path.volume_bounce < 255u) path.volume_bounce++;  // larger limits are those of all bounces
    if (path.bounce >= limits.bounces || path.volume_bounce >= limits.volume) flags |= PATH_LAST_BOUNCE;
    if (!(flags & PATH_PASS_CHOSEN)) flags |= u32(PATH_PASS_CHOSEN) | u32(PATH_VOLUME_PASS);
    path.flags = flags;
    path.visibility = RAY_VOLUME;
}

// With which probability a flight is free, to end where the medium has it; else it goes past all scattering. A path
// that may turn but once more would find little there that lights, sampled, do not bring anyway: what lies behind
// is worth more of the samples. 0: it could find nothing.
inline constexpr float LAST_TURN_CHANCE = 0.25f;

LUCH_FN float turning_chance(const RenderView& scene, const PathState& path) {
    bool last = path.bounce + 1u >= scene.limits.bounces || path.volume_bounce + 1u >= scene.limits.volume;
    if (!last || scene.media.last_turn_matters || gathers_features(path)) return 1.0f;
    return scene.can_meet_light ? LAST_TURN_CHANCE : 0.0f;
}

enum class FlightEnd : u32 { AT_SURFACE, SCATTERED, LOST };

// What a flight without scattering, or past all of it, leaves of the path.
LUCH_FN FlightEnd dim_path(PathState& path, Color weight) {
    path.throughput *= weight;
    path.feature_throughput *= weight;
    return is_zero(path.throughput) || !finite_v(path.throughput) ? FlightEnd::LOST : FlightEnd::AT_SURFACE;
}

// Turns the path at a point of its flight. weight: of arriving there, over the density.
LUCH_FN_SLOW FlightEnd scatter_path(const RenderView& scene, FilmWriter& writer, PathState& path,
                                    const MediumStack& stack, const Ray& ray, const Flight& flight, float t,
                                    Color weight, Ray* next) {
    Vec3 u = sample_3d(path.sampler, path.dimension + FLIGHT_PHASE);
    Vec3 direction = sample_media_phase(scene.media, stack, ray.direction, u);
    float pdf;
    Color value = eval_media_phase(scene.media, stack, ray.direction, direction, &pdf);
    if (gathers_features(path)) {
        Color albedo = share(flight.sum.scattering, flight.sum.extinction);
        film_add(writer, path.pixel, writer.film.layout.denoising_albedo, path.feature_throughput * albedo);
        path.flags &= ~u32(PATH_FEATURES);
    }
    path.throughput *= weight * value * safe_divide(1.0f, pdf);
    Vec3 p = ray.origin + ray.direction * keep_inside(t, flight.length, ray);
    if (is_zero(path.throughput) || !(pdf > 0.0f)) return FlightEnd::LOST;
    if (!finite_v(path.throughput) || !finite_v(p)) {
        count_one(writer.refused + REFUSED_FLIGHT);
        return FlightEnd::LOST;
    }
    float going_on = continuation_probability(path, scene.limits);
    if (going_on < 1.0f) {
        if (!(sample_1d(path.sampler, path.dimension + FLIGHT_TERMINATE) < going_on)) return FlightEnd::LOST;
        path.throughput *= 1.0f / going_on;
    }
    path.mis_pdf = pdf;
    path.min_pdf = min_f(path.min_pdf, pdf);
    path.mis_origin = p;
    path.mis_normal = make_vec3(0.0f);
    path.footprint += (path.travelled + t) * path.spread;
    path.travelled = 0.0f;
    count_volume_bounce(path, scene.limits);
    if (looks_for_light_alone(path) && !scene.can_meet_light) return FlightEnd::LOST;
    *next = {p, 0.0f, direction, INFINITE_DISTANCE};
    return FlightEnd::SCATTERED;
}

// Takes the path as far as its ray's next surface, or to where it scatters: then *next is its ray.
LUCH_FN_SLOW FlightEnd fly(const RenderView& scene, FilmWriter& writer, PathState& path, const MediumStack& stack,
                           const Ray& ray, const Flight& flight, Ray* next) {
    const Color extinction = flight.sum.extinction;
    if (!is_zero(flight.sum.emission)) add_medium_emission(scene, writer, path, stack, flight);
    if (!may_scatter(path, flight)) return dim_path(path, transmitted(extinction, flight.length));
    Vec2 u = sample_2d(path.sampler, path.dimension + FLIGHT_DISTANCE);
    float chance = turning_chance(scene, path), chosen = pick_channel(flight.carried, extinction, u.y);
    bool free = u.x < chance && chosen > 0.0f;
    float t = free ? -log_f(1.0f - min_f(u.x / chance, BELOW_ONE)) / chosen : INFINITE_DISTANCE;
    FlightEnd end;
    if (t < flight.length) {
        Color through = transmitted(extinction, t);
        float density = chance * channel_sum(flight.carried * extinction * through);
        end = scatter_path(scene, writer, path, stack, ray, flight, t, through * safe_divide(1.0f, density), next);
    } else {
        Color through = transmitted(extinction, flight.length);
        float probability = chance * channel_sum(flight.carried * through) + (1.0f - chance);
        end = dim_path(path, through * safe_divide(1.0f, probability));
    }
    path.dimension += DIMENSIONS_PER_FLIGHT;
    return end;
}

// ---- borders -------------------------------------------------------------------------------------

// The media on the other side of a surface that a ray goes through. from_behind: of the ray that came there.
LUCH_FN MediumStack media_beyond(const RenderView& scene, const MediumStack& stack, u32 instance, u32 prim,
                                 bool from_behind) {
    MediumStack beyond = stack;
    cross_border(scene.view, beyond, instance, prim, from_behind);
    return beyond;
}

// The media around a ray that leaves a shaded surface.
LUCH_FN MediumStack media_towards(const RenderView& scene, const MediumStack& stack, const ShadePoints& points,
                                  int lane, Vec3 direction) {
    if (!(dot(direction, lane_face_normal(points, lane)) < 0.0f)) return stack;
    return media_beyond(scene, stack, points.instance[lane], points.prim[lane], points.flags[lane] & PATH_BACKFACING);
}

// The media around a camera ray's beginning: those at the camera, and the borders on the way from it.
// tracer.closest_of_all(ray) gives a Hit at tracer.time.
template <class Tracer>
LUCH_FN MediumStack media_at_lens(const RenderView& scene, Vec3 to, Tracer& tracer) {
    MediumStack stack = scene.media.camera;
    if (!scene.media.camera_walks) return stack;
    Vec3 way = to - scene.media.camera_position;
    float rest = length(way);
    if (!(rest > 0.0f)) return stack;
    Ray ray = {scene.media.camera_position, 0.0f, way * (1.0f / rest), rest};
    for (u32 passed = 0; passed < MAX_CAMERA_BORDERS && ray.t_max > 0.0f; ++passed) {
        Hit hit = tracer.closest_of_all(ray);
        if (hit.instance == NONE) break;
        pass_surface(scene.view, stack, hit, tracer.time, &ray);
    }
    return stack;
}

}  // namespace luch

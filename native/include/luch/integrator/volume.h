// What happens to a path between two surfaces where the space is not empty: it is dimmed, gathers the medium's own
// light, is lit at some point, and may scatter there and go on elsewhere.
//
// Free flight: a channel is chosen by what the path still carries, a distance by that channel's extinction; the weight
// divides by the mean of all channels' densities (spectral multiple importance sampling), so that colours do not fight.
// Light at a point of its own: distances by the medium and by the light's nearness (equiangular; Kulla and Fajardo
// 2012, "Importance Sampling Techniques for Path Tracing in Participating Media"), combined by the balance heuristic.
#pragma once
#include "luch/integrator/direct_light.h"
#include "luch/integrator/medium.h"

namespace luch {

// A hit's prim, beside instance NONE, where a ray met no surface since its path scattered or ended before.
inline constexpr u32 ENDED_IN_MEDIUM = NONE - 1u;

LUCH_FN bool missed_all(const Hit& hit) {
    return hit.instance == NONE && !(plan::VOLUMES && hit.prim == ENDED_IN_MEDIUM);
}

// Sobol dimensions of one flight through a medium, beside those of the event that follows.
inline constexpr u32 DIMENSIONS_PER_FLIGHT = 7;
enum FlightDimension : u32 {
    FLIGHT_DISTANCE,
    FLIGHT_LIT,
    FLIGHT_REFERENCE,
    FLIGHT_PIVOT,
    FLIGHT_LIGHT,
    FLIGHT_PHASE,
    FLIGHT_TERMINATE
};

// Borders between the camera and its lens, or near clip, that are looked at.
inline constexpr u32 MAX_CAMERA_BORDERS = 64;

// Points stay this far from both ends of a flight, so that rounding leaves none on the other side of a border: a
// part of its length, and of the size of its coordinates (16 ulp).
inline constexpr float FLIGHT_MARGIN = 1e-6f;

LUCH_FN float channel_sum(Color c) { return c.x + c.y + c.z; }

LUCH_FN float keep_inside(float t, float length, const Ray& ray) {
    if (!finite_f(length)) return t;
    float margin = FLIGHT_MARGIN * (length + max_component(abs_v(ray.origin)));
    return max_f(min_f(t, length - margin), min_f(margin, 0.5f * length));
}

// One of the colour's channels by u in [0, 1), in proportion to positive weights.
LUCH_FN float pick_channel(Color weights, Color values, float u) {
    float target = u * channel_sum(weights);
    if (target < weights.x) return values.x;
    if (target < weights.x + weights.y || !(weights.z > 0.0f)) return weights.y > 0.0f ? values.y : values.x;
    return values.z;
}

// Of a flight as far as `length`: what a metre of it does, and what of the path's light each channel carries.
struct Flight {
    MediumSum sum;
    Color carried;  // relative, sums to 1
    float length;
};

LUCH_FN Flight make_flight(const MediaView& media, const MediumStack& stack, const PathState& path, float length) {
    Flight flight{sum_media(media, stack), abs_v(path.throughput), length};
    float sum = channel_sum(flight.carried);
    flight.carried = sum > 0.0f && finite_f(sum) ? flight.carried * (1.0f / sum) : make_vec3(1.0f / 3.0f);
    return flight;
}

// ---- the medium's own light ----------------------------------------------------------------------

LUCH_FN_SLOW void add_medium_emission(const RenderView& scene, FilmWriter& writer, const PathState& path,
                                      const MediumStack& stack, const Flight& flight) {
    Color reach = transmitted_length(flight.sum.extinction, flight.length);
    for_each_medium(scene.media, stack, [&](const MediumView& medium, u32 instance) {
        if (is_zero(medium.emission)) return;
        u32 group = instance == NONE ? scene.world_lightgroup
                                     : scene.view.objects[scene.view.instances[instance].object].lightgroup;
        add_emission(scene, writer, path, medium.emission * reach, writer.film.layout.emission, group);
    });
}

// ---- a point of the flight to be lit --------------------------------------------------------------

// Distances as the medium scatters: density within the flight, summed over channels by their part in what they bring.
struct FlightDensity {
    Color weights;  // sum to 1
    Color extinction, length_inverse;  // the latter: 1 / transmitted_length
};

LUCH_FN bool make_flight_density(const Flight& flight, FlightDensity* d) {
    Color reach = transmitted_length(flight.sum.extinction, flight.length);
    d->weights = flight.carried * flight.sum.scattering * reach;
    float sum = channel_sum(d->weights);
    if (!(sum > 0.0f && finite_f(sum))) return false;
    d->weights *= 1.0f / sum;
    d->extinction = flight.sum.extinction;
    d->length_inverse = {safe_divide(1.0f, reach.x), safe_divide(1.0f, reach.y), safe_divide(1.0f, reach.z)};
    return true;
}

LUCH_FN float flight_density(const FlightDensity& d, float t) {
    Color through = transmitted(d.extinction, t);
    return channel_sum(d.weights * through * d.length_inverse);
}

LUCH_FN float sample_flight_density(const FlightDensity& d, float reach, float u_channel, float u) {
    float extinction = pick_channel(d.weights, d.extinction, u_channel);
    float x = extinction * reach;
    // In thin media the logarithm would lose all digits; the inverse to first order leaves a relative error of
    // x^2 / 12.
    if (!(x > 1e-3f)) return reach * u * (1.0f - 0.5f * x * (1.0f - u));
    float covered = finite_f(x) ? 1.0f - exp_f(-x) : 1.0f;
    return min_f(-log_f(1.0f - u * covered) / extinction, reach);
}

// Distances by the angle under which a light sees them.
struct Equiangular {
    float foot, height;  // of the light's perpendicular on the ray: where, and how long
    float from, to;  // angles of both ends
};
// Nothing is sampled farther from the foot than so many heights; and the angle of that.
inline constexpr float EQUIANGULAR_REACH = 1e4f, EQUIANGULAR_STEEPEST = 1.57069633f;

LUCH_FN Equiangular make_equiangular(const Ray& ray, float reach, Vec3 pivot) {
    Vec3 to_pivot = pivot - ray.origin;
    Equiangular e;
    e.foot = dot(to_pivot, ray.direction);
    // A light on the ray itself: any height gives a density, one that is not 0 gives one without poles.
    e.height = max_f(length(to_pivot - ray.direction * e.foot), 1e-4f * max_f(abs_f(e.foot), 1e-6f));
    e.from = max_f(atan2_f(-e.foot, e.height), -EQUIANGULAR_STEEPEST);
    e.to = min_f(finite_f(reach) ? atan2_f(reach - e.foot, e.height) : HALF_PI, EQUIANGULAR_STEEPEST);
    return e;
}

LUCH_FN float equiangular_density(const Equiangular& e, float t) {
    float spread = e.to - e.from, away = t - e.foot;
    if (!(spread > 0.0f) || abs_f(away) > EQUIANGULAR_REACH * e.height) return 0.0f;
    return e.height / (spread * (sqr(e.height) + sqr(away)));
}

LUCH_FN float sample_equiangular(const Equiangular& e, float u) {
    return e.foot + e.height * tan_f(mix_f(e.from, e.to, u));
}

// A light that the flight passes at a finite distance, as seen from some point of it: where the nearness of lights
// will be looked for. False: there is none.
LUCH_FN_SLOW bool choose_pivot(const RenderView& scene, const PathState& path, const Ray& ray,
                               const FlightDensity& density, float reach, Vec3* pivot) {
    if (scene.view.lights->emitter_count == 0u) return false;
    Vec2 v = sample_2d(path.sampler, path.dimension + FLIGHT_REFERENCE);
    Vec3 u = sample_3d(path.sampler, path.dimension + FLIGHT_PIVOT);
    float t = sample_flight_density(density, reach, v.y, v.x);
    LightSample s = sample_light(scene.view, ray.origin + ray.direction * t, make_vec3(0.0f), true, u.z, {u.x, u.y});
    *pivot = s.point;
    return s.kind != EmitterKind::NONE_ && finite_f(s.distance) && finite_v(s.point);
}

// Where a flight is lit, and the inverse of that point's density: by the medium, by a light's nearness, or as likely
// by either.
LUCH_FN_SLOW float choose_lit_point(const RenderView& scene, const PathState& path, const Ray& ray,
                                    const FlightDensity& density, float reach, float* inverse_density) {
    Vec3 u = sample_3d(path.sampler, path.dimension + FLIGHT_LIT), pivot;
    if (!choose_pivot(scene, path, ray, density, reach, &pivot)) {
        float t = sample_flight_density(density, reach, u.z, u.x);
        *inverse_density = safe_divide(1.0f, flight_density(density, t));
        return t;
    }
    Equiangular e = make_equiangular(ray, reach, pivot);
    bool by_medium = u.z < 0.5f;
    float t = by_medium ? sample_flight_density(density, reach, 2.0f * u.z, u.x) : sample_equiangular(e, u.x);
    t = clamp_f(t, 0.0f, reach);
    *inverse_density = safe_divide(1.0f, 0.5f * (flight_density(density, t) + equiangular_density(e, t)));
    return t;
}

// ---- light for that point ------------------------------------------------------------------------

// Emission of a light's program at the sampled place. shader.light as in walk_transparent.
template <class Shader>
LUCH_FN Color sampled_emission(const RenderView& scene, const PathState& path, u32 path_index, const LightSample& s,
                               float footprint, Shader& shader, ShadePoints& points) {
    ConstantEmission constant = emission_of(scene, s);
    if (!plan::SAMPLED_PROGRAMS || constant.constant) return constant.radiance;
    points.count = 1;
    setup_light_lane(scene, path, path_index, s, footprint, points, 0);
    return shader.light(program_of(scene, s), points).emission;
}

LUCH_FN Ray ray_to_light(Vec3 p, const LightSample& s) {
    float reach = finite_f(s.distance) ? s.distance * (1.0f - LIGHT_SHORTENING) : s.distance;
    return {p, 0.0f, s.direction, reach};
}

// Next-event estimation at one point of a flight; false where nothing is to be brought.
template <class Shader>
LUCH_FN bool light_flight(const RenderView& scene, const PathState& path, u32 path_index, const MediumStack& stack,
                          const Ray& ray, const Flight& flight, Shader& shader, ShadePoints& points, Ray* to_light,
                          ShadowRay* shadow) {
    FlightDensity density;
    if (!scene.has_lights || !make_flight_density(flight, &density)) return false;
    float inverse_density;
    float t = choose_lit_point(scene, path, ray, density, flight.length, &inverse_density);
    Color through = transmitted(flight.sum.extinction, t);
    t = keep_inside(t, flight.length, ray);
    Vec3 p = ray.origin + ray.direction * t, u = sample_3d(path.sampler, path.dimension + FLIGHT_LIGHT);
    if (is_zero(through) || !finite_v(p) || !(inverse_density > 0.0f)) return false;
    LightSample s = sample_light(scene.view, p, make_vec3(0.0f), true, u.z, {u.x, u.y});
    if (s.kind == EmitterKind::NONE_ || !(s.pdf_sa > 0.0f) || !(s.visibility & RAY_VOLUME)) return false;
    if (light_is_spent(*scene.view.lights, s, path.bounce)) return false;
    float footprint = path.footprint + (path.travelled + t) * path.spread;
    Color light = sampled_emission(scene, path, path_index, s, footprint, shader, points) * s.radiance;
    if (is_zero(light)) return false;
    float phase_pdf;
    Color scattered = eval_media_phase(scene.media, stack, ray.direction, s.direction, &phase_pdf);
    float weight = inverse_density * (s.mis ? mis_weight(s.pdf_sa, phase_pdf) : 1.0f) / s.pdf_sa;
    *shadow = ShadowRay{};
    shadow->contribution = path.throughput * through * scattered * light * weight;
    if (is_zero(shadow->contribution)) return false;
    shadow->pass_diffuse = path.pass_diffuse;
    shadow->pass_glossy = path.pass_glossy;
    shadow->volume_pass = !(path.flags & PATH_PASS_CHOSEN) || (path.flags & PATH_VOLUME_PASS);
    shadow->path = path_index;
    shadow->bounce = path.bounce;
    shadow->transparent_depth = path.transparent_bounce;
    shadow->depth = depth_word(path);
    shadow->footprint = footprint;
    shadow->lightgroup = s.lightgroup;
    shadow->casts = s.cast_shadow;
    *to_light = ray_to_light(p, s);
    return true;
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
        ++writer.rejected;
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
    float t = free ? -log_f(1.0f - min_f(u.x / chance, 0.99999994f)) / chosen : INFINITE_DISTANCE;
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
// tracer.closest_of_all(ray) gives a Hit.
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
        pass_surface(scene.view, stack, hit, &ray);
    }
    return stack;
}

}  // namespace luch

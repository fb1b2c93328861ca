// Light for a point of a flight through media: distances by the medium and by the light's nearness (equiangular; Kulla
// and Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media"), combined by the balance
// heuristic; then a light for that point, as for a surface's.
#pragma once
#include "luch/integrator/flight.h"
#include "luch/math/bounds.h"

namespace luch {

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
    if (!(x > THIN_FLIGHT)) return reach * u * (1.0f - 0.5f * x * (1.0f - u));
    float covered = finite_f(x) ? 1.0f - exp_f(-x) : 1.0f;
    return min_f(-log_f(1.0f - u * covered) / extinction, reach);
}

// Distances by the angle under which a light sees them.
struct Equiangular {
    float foot, height;  // of the light's perpendicular on the ray: where, and how long
    float from, to;  // angles of both ends
};

LUCH_FN Equiangular make_equiangular(const Ray& ray, float reach, Vec3 pivot) {
    Vec3 to_pivot = pivot - ray.origin;
    Equiangular e;
    e.foot = dot(to_pivot, ray.direction);
    // A light on the ray itself: any height gives a density, one that is not 0 gives one without poles.
    e.height = max_f(length(to_pivot - ray.direction * e.foot),
                     EQUIANGULAR_LEAST_HEIGHT * max_f(abs_f(e.foot), EQUIANGULAR_LEAST_FOOT));
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
                               const FlightDensity& density, float reach, float time, Vec3* pivot) {
    if (scene.view.lights->emitter_count == 0u) return false;
    Vec2 v = sample_2d(path.sampler, path.dimension + FLIGHT_REFERENCE);
    Vec3 u = sample_3d(path.sampler, path.dimension + FLIGHT_PIVOT);
    float t = sample_flight_density(density, reach, v.y, v.x);
    LightSample s =
        sample_light(scene.view, ray.origin + ray.direction * t, make_vec3(0.0f), true, u.z, {u.x, u.y}, time);
    *pivot = s.point;
    return s.kind != EmitterKind::NONE_ && finite_f(s.distance) && finite_v(s.point);
}

// Where a flight is lit, and the inverse of that point's density: by the medium, by a light's nearness, or as likely
// by either.
LUCH_FN_SLOW float choose_lit_point(const RenderView& scene, const PathState& path, const Ray& ray,
                                    const FlightDensity& density, float reach, float time, float* inverse_density) {
    Vec3 u = sample_3d(path.sampler, path.dimension + FLIGHT_LIT), pivot;
    if (!choose_pivot(scene, path, ray, density, reach, time, &pivot)) {
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
                               float footprint, float time, Shader& shader, ShadePoints& points) {
    ConstantEmission constant = emission_of(scene, s, time);
    if (!plan::SAMPLED_PROGRAMS || constant.constant) return constant.radiance;
    points.count = 1;
    setup_light_lane(scene, path, path_index, s, footprint, time, points, 0);
    return shader.light(program_of(scene, s), points).emission;
}

LUCH_FN Ray ray_to_light(Vec3 p, const LightSample& s) {
    float reach = finite_f(s.distance) ? s.distance * (1.0f - LIGHT_SHORTENING) : s.distance;
    return {p, 0.0f, s.direction, reach};
}

// Next-event estimation at one point of a flight; false where nothing is to be brought. time: of the path.
template <class Shader>
LUCH_FN bool light_flight(const RenderView& scene, const PathState& path, u32 path_index, const MediumStack& stack,
                          const Ray& ray, const Flight& flight, float time, Shader& shader, ShadePoints& points,
                          Ray* to_light, ShadowRay* shadow) {
    FlightDensity density;
    if (!scene.has_lights || !make_flight_density(flight, &density)) return false;
    float inverse_density;
    float t = choose_lit_point(scene, path, ray, density, flight.length, time, &inverse_density);
    Color through = transmitted(flight.sum.extinction, t);
    t = keep_inside(t, flight.length, ray);
    Vec3 p = ray.origin + ray.direction * t, u = sample_3d(path.sampler, path.dimension + FLIGHT_LIGHT);
    if (is_zero(through) || !finite_v(p) || !(inverse_density > 0.0f)) return false;
    LightSample s = sample_light(scene.view, p, make_vec3(0.0f), true, u.z, {u.x, u.y}, time);
    if (s.kind == EmitterKind::NONE_ || !(s.pdf_sa > 0.0f) || !(s.visibility & RAY_VOLUME)) return false;
    if (light_is_spent(*scene.view.lights, s, path.bounce)) return false;
    float footprint = path.footprint + (path.travelled + t) * path.spread;
    Color light = sampled_emission(scene, path, path_index, s, footprint, time, shader, points) * s.radiance;
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

}  // namespace luch

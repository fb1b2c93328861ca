// Christensen and Burley's profile of light that scattered under a flat surface, probed: a ray along an axis of the
// place where light went in finds where it comes out. Sources: Christensen and Burley 2015, "Approximate reflectance
// profiles for efficient subsurface scattering"; King, Kulla, Conty and Fajardo 2013, "BSSRDF importance sampling".
#pragma once
#include "luch/integrator/subsurface.h"
#include "luch/math/bounds.h"

namespace luch {

// Surfaces that a probe looks at; a folded mesh may have more within reach, which are left out.
inline constexpr u32 PROBE_HITS = 16;

// Light at distance r, a ring of unit width: integrates to 1. A length of 0 is no profile.
LUCH_FN float profile(float length, float r) {
    if (!(r > 0.0f) || !(r < PROFILE_REACH * length)) return 0.0f;
    float third = exp_f(-r / (3.0f * length));
    return (third * third * third + third) / (4.0f * length * PROFILE_SHARE);
}
LUCH_FN Color profile(Vec3 length, float r) {
    return {profile(length.x, r), profile(length.y, r), profile(length.z, r)};
}
// r / length of that density: inverts 1 - e^-x / 4 - 3/4 e^(-x/3), a cubic in e^(-x/3).
LUCH_FN float sample_profile(float u) {
    float rest = 2.0f * (1.0f - u * PROFILE_SHARE);
    float third = log_f(rest + sqrt_f(1.0f + sqr(rest))) * (1.0f / 3.0f);
    return clamp_f(-3.0f * log_f(2.0f * sinh_f(third)), 0.0f, PROFILE_REACH);
}

LUCH_FN float channel_count(Vec3 length) {
    return float(int(length.x > 0.0f) + int(length.y > 0.0f) + int(length.z > 0.0f));
}
// A radius by one of the channels that have a profile.
LUCH_FN float sample_radius(Vec3 length, float u, float* reach) {
    float scaled = u * channel_count(length), chosen = 0.0f;
    for (int k = 0; k < 3; ++k) {
        if (!(length[k] > 0.0f)) continue;
        chosen = length[k];
        if (scaled < 1.0f) break;
        scaled -= 1.0f;
    }
    float r = sample_profile(min_f(scaled, BELOW_ONE)) * chosen;
    *reach = safe_sqrt(sqr(PROFILE_REACH * chosen) - sqr(r));
    return r;
}

// The frame of a probe: the normal half of the time, else one of the tangents; shares: how often each is chosen.
struct ProbeAxes {
    Vec3 along, across, other;
    float share_along, share_across, share_other;
};
LUCH_FN ProbeAxes choose_axes(Vec3 n, float* u) {
    Vec3 t, b;
    make_frame(n, &t, &b);
    if (*u < 0.5f) {
        *u *= 2.0f;
        return {n, t, b, 0.5f, 0.25f, 0.25f};
    }
    bool first = *u < 0.75f;
    *u = min_f((*u - (first ? 0.5f : 0.75f)) * 4.0f, BELOW_ONE);
    if (first) return {t, n, b, 0.25f, 0.5f, 0.25f};
    return {b, t, n, 0.25f, 0.25f, 0.5f};
}

// The face's normal on the side that light went in on, at that time.
LUCH_FN Vec3 probed_normal(const SceneView& scene, const SubsurfaceWalk& walk, u32 prim, float time) {
    InstanceView moved;
    const InstanceView& instance = instance_at_time(scene, walk.instance, time, &moved);
    Vec3 n = world_face_normal(instance, triangle_at(scene, instance, prim, time));
    return walk.back ? -n : n;
}

// Weight of a surface that the probe meets: over the three axes by the power heuristic, over channels by the balance
// heuristic. As in Cycles the ring's width is that of the probe and not of the true distance.
LUCH_FN Color probe_weight(const SubsurfaceWalk& walk, const ProbeAxes& axes, Vec3 normal, float r, float pdf) {
    float along = axes.share_along * abs_f(dot(axes.along, normal));
    float across = axes.share_across * abs_f(dot(axes.across, normal));
    float other = axes.share_other * abs_f(dot(axes.other, normal));
    return profile(walk.radius, r) * (safe_divide(along, sqr(along) + sqr(across) + sqr(other)) / pdf);
}

// One surface of all that the probe meets, in proportion to their weights. tracer as in take_step.
template <class Tracer>
LUCH_FN void probe_disk(const SceneView& scene, SubsurfaceWalk& walk, Tracer& tracer, u64* rays) {
    walk.hit.instance = NONE;
    Vec3 u = sample_3d(walk.sampler, walk.dimension);
    float turn = u.y, reach, s, c;
    ProbeAxes axes = choose_axes(walk.normal, &turn);
    float ring = sample_radius(walk.radius, u.x, &reach);
    sincos_turns(turn, &s, &c);
    Color densities = profile(walk.radius, ring);
    float pdf = (densities.x + densities.y + densities.z) / channel_count(walk.radius);
    if (!(pdf > 0.0f)) return;
    Vec3 start = walk.entry + axes.along * reach + (axes.across * c + axes.other * s) * ring;
    Ray ray = {start, 0.0f, -axes.along, 2.0f * reach};
    Color kept = make_vec3(0.0f);
    float sum = 0.0f, choice = u.z;
    for (u32 k = 0; k < PROBE_HITS; ++k) {
        Hit hit = tracer.closest(walk.instance, ray);
        ++*rays;
        if (hit.instance == NONE) break;
        Vec3 normal = probed_normal(scene, walk, hit.prim, tracer.time);
        float distance = length(ray.origin + ray.direction * hit.t - walk.entry);
        Color weight = probe_weight(walk, axes, normal, distance, pdf);
        float mean = average(weight);
        sum += mean;
        // A reservoir of one: the number is made anew from what the choice leaves of it.
        float take = safe_divide(mean, sum);
        if (choice < take) {
            choice = choice / take;
            walk.hit = hit;
            walk.direction = normal;
            kept = weight * (1.0f / mean);
        } else {
            choice = min_f((choice - take) / (1.0f - take), BELOW_ONE);
        }
        ray.t_min = bits_float(float_bits(max_f(hit.t, 1e-30f)) + 1u);
        if (!(ray.t_min < ray.t_max)) break;
    }
    walk.throughput *= kept * sum;
    if (!finite_v(walk.throughput) || is_zero(walk.throughput)) walk.hit.instance = NONE;
}

// From where light goes in to where it comes out.
template <class Tracer>
LUCH_FN void pass_inside(const SceneView& scene, SubsurfaceWalk& walk, Tracer& tracer, u64* rays) {
    if (walk.probe)
        probe_disk(scene, walk, tracer, rays);
    else
        walk_inside(walk, tracer, rays);
}

}  // namespace luch

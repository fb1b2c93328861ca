// Light sampling as the integrator asks for it: one choice among all emitters, then a direction towards
// the chosen one; and, for a ray that found an emitter by itself, the density of that very choice.
//
// Three groups: local emitters (under the light tree), suns, the world. Shares follow rough unoccluded irradiance,
// with a part dealt evenly, since what hides a group (a roof, a wall) is not known here. An even world has no part in
// that: rays find it by themselves.
#pragma once
#include "luch/light/closest_lamp.h"
#include "luch/light/tree.h"
#include "luch/light/triangle.h"
#include "luch/light/world.h"
#include "luch/math/bounds.h"
#include "luch/plan.h"

namespace luch {

inline constexpr float EVEN_SHARE = 0.15f;

struct GroupShares {
    float local, suns, world;         // probabilities; all 0: nothing to sample
    float root_sum;                   // of root, when root_ready
    bool root_ready;
    alignas(64) float root[LIGHT_WIDTH];
};

LUCH_FN float sun_importance(const LightsView& lights, u32 sun, const LightQuery& q) {
    const LampView& lamp = lights.lamps[lights.suns[sun]];
    float c = -dot(q.n, lamp.direction);
    c = q.transmits ? abs_f(c) : c;
    // cos(angle - half) <= cos(angle) + sin(half): never 0 while a part of the disk is above the horizon.
    float sine = safe_sqrt(1.0f - sqr(lamp.cos_half_angle));
    return lights.sun_irradiance[sun] * (q.volume ? 1.0f : min_f(max_f(c + sine, 0.0f), 1.0f));
}

LUCH_FN float suns_importance(const LightsView& lights, const LightQuery& q) {
    float sum = 0.0f;
    for (u32 i = 0; i < lights.sun_count; ++i) sum += sun_importance(lights, i, q);
    return sum;
}

LUCH_FN_SLOW void group_shares(const LightsView& lights, const LightQuery& q, GroupShares* s) {
    bool any_world = lights.world.present && lights.world.irradiance > 0.0f;
    u32 groups = (lights.emitter_count > 0u) + (lights.sun_count > 0u) + (any_world ? 1u : 0u);
    s->root_ready = false;
    s->local = lights.emitter_count > 0u ? 1.0f : 0.0f;
    s->suns = lights.sun_count > 0u ? 1.0f : 0.0f;
    s->world = any_world ? 1.0f : 0.0f;
    if (groups <= 1u) return;
    if (lights.uniform) {
        float scale =
            1.0f / (static_cast<float>(lights.emitter_count) + static_cast<float>(lights.sun_count) + s->world);
        s->local = static_cast<float>(lights.emitter_count) * scale;
        s->suns = static_cast<float>(lights.sun_count) * scale;
        s->world *= scale;
        return;
    }
    if (lights.emitter_count > 0u) {
        s->root_sum = node_importances(lights.nodes[0], q, s->root);
        s->local = s->root_sum;
        s->root_ready = true;
    }
    if (lights.sun_count > 0u) s->suns = suns_importance(lights, q);
    if (any_world) {
        const WorldLight& w = lights.world;
        s->world = w.has_sun ? w.map_irradiance + world_sun_irradiance(w, q.n, q.transmits) : w.irradiance;
    }
    float total = s->local + s->suns + s->world;
    bool even_world = lights.world.constant && !lights.world.has_sun;
    float active = (s->local > 0.0f ? 1.0f : 0.0f) + (s->suns > 0.0f ? 1.0f : 0.0f) +
                   (s->world > 0.0f && !even_world ? 1.0f : 0.0f);
    bool usable = total > 0.0f && finite_f(total);
    bool deal = usable && active > 0.0f;
    float even = deal ? EVEN_SHARE / active : 0.0f;
    float scale = usable ? (deal ? 1.0f - EVEN_SHARE : 1.0f) / total : 0.0f;
    s->local = s->local > 0.0f ? s->local * scale + even : 0.0f;
    s->suns = s->suns > 0.0f ? s->suns * scale + even : 0.0f;
    s->world = s->world > 0.0f ? s->world * scale + (even_world ? 0.0f : even) : 0.0f;
}

// ---- choosing ------------------------------------------------------------------------------------

LUCH_FN_SLOW EmitterChoice choose_local(const LightsView& lights, const LightQuery& q, GroupShares* s, float u,
                                        Vec2 other) {
    if (lights.emitter_count == 1u) return {0u, 1.0f};
    if (lights.uniform) {
        float count = static_cast<float>(lights.emitter_count);
        u32 index = static_cast<u32>(u * count);
        return {index < lights.emitter_count ? index : lights.emitter_count - 1u, 1.0f / count};
    }
    if (!s->root_ready) s->root_sum = node_importances(lights.nodes[0], q, s->root);
    if (!(s->root_sum > 0.0f)) return {NONE, 0.0f};
    return choose_emitter(lights, q, s->root, s->root_sum, u, other);
}

LUCH_FN float local_probability(const LightsView& lights, const LightQuery& q, u32 emitter) {
    if (lights.emitter_count == 1u) return 1.0f;
    if (lights.uniform) return 1.0f / static_cast<float>(lights.emitter_count);
    return emitter_probability(lights, q, emitter);
}

LUCH_FN float sun_probability(const LightsView& lights, const LightQuery& q, u32 sun) {
    if (lights.sun_count == 1u) return 1.0f;
    if (lights.uniform) return 1.0f / static_cast<float>(lights.sun_count);
    return safe_divide(sun_importance(lights, sun, q), suns_importance(lights, q));
}

// Index into LightsView::suns.
LUCH_FN_SLOW EmitterChoice choose_sun(const LightsView& lights, const LightQuery& q, float u) {
    float running = 0.0f;
    EmitterChoice choice{NONE, 0.0f};
    for (u32 i = 0; i < lights.sun_count; ++i) {
        float probability = sun_probability(lights, q, i);
        if (probability > 0.0f && (choice.emitter == NONE || running <= u)) choice = {i, probability};
        running += probability;
    }
    return choice;
}

// ---- sampling ------------------------------------------------------------------------------------

LUCH_FN LightSample no_light_sample() {
    LightSample s{};
    s.kind = EmitterKind::NONE_;
    s.lamp = s.instance = s.prim = NONE;
    return s;
}

LUCH_FN LightSample light_sample_at(const LightsView& lights, u32 index, const LampSample& at, float probability) {
    const LampView& lamp = lights.lamps[index];
    LightSample s = no_light_sample();
    s.pdf_sa = at.pdf_sa * probability;
    if (!at.valid || !(s.pdf_sa > 0.0f)) return s;
    s.kind = EmitterKind::LAMP;
    s.delta = lamp.delta;
    s.mis = lamp.mis;
    s.direction = at.direction;
    s.distance = at.distance;
    s.radiance = at.radiance;
    s.lamp = index;
    s.u = at.u;
    s.v = at.v;
    s.point = at.point;
    s.normal = at.normal;
    s.visibility = lamp.visibility;
    s.lightgroup = lamp.lightgroup;
    s.cast_shadow = lamp.cast_shadow;
    return s;
}

LUCH_FN_SLOW LightSample sample_chosen_lamp(const LightsView& lights, u32 index, const LightQuery& q, float probability,
                                            Vec2 u) {
    LampSample at = sample_lamp(lights.lamps[index], q.p, q.n, q.transmits, u);
    return light_sample_at(lights, index, at, probability);
}

LUCH_FN_SLOW LightSample sample_chosen_triangle(const SceneView& scene, Emitter emitter, const LightQuery& q,
                                                float probability, float u_cluster, Vec2 u, float time) {
    if (emitter.prim == NONE) {
        const InstanceView& instance = scene.instances[emitter.instance];
        const float* cdf = scene.lights->cluster_cdf + scene.lights->instances[emitter.instance].cdf;
        float within;
        emitter.prim = find_interval(cdf, scene.meshes[instance.mesh].triangle_count, u_cluster, &within);
        probability *= cdf[emitter.prim + 1u] - cdf[emitter.prim];
    }
    WorldTriangle triangle = make_world_triangle(scene, emitter.instance, emitter.prim, q.p, time);
    const TriangleCone& cone = triangle.cone;
    LightSample s = no_light_sample();
    if (!triangle.sends) return s;
    Vec2 b = sample_triangle_cone(cone, u);
    if (b.x < 0.0f) return s;
    Vec3 along = cone.a + cone.e1 * b.x + cone.e2 * b.y;
    s.distance = length(along);
    s.pdf_sa = triangle_cone_pdf(cone, s.distance) * probability;
    if (!(s.distance > 0.0f && s.pdf_sa > 0.0f)) return s;
    s.kind = EmitterKind::TRIANGLE;
    s.mis = true;
    s.direction = along / s.distance;
    s.radiance = {1.0f, 1.0f, 1.0f};
    s.instance = emitter.instance;
    s.prim = emitter.prim;
    s.u = b.x;
    s.v = b.y;
    s.point = q.p + along;
    s.normal = cone.height < 0.0f ? cone.unit_normal : -cone.unit_normal;
    const InstanceView& instance = scene.instances[emitter.instance];
    s.visibility = instance.visibility;
    s.lightgroup = scene.objects[instance.object].lightgroup;
    s.cast_shadow = true;
    return s;
}

LUCH_FN_SLOW LightSample sample_chosen_world(const WorldLight& world, const LightQuery& q, float probability, Vec2 u) {
    LightSample s = no_light_sample();
    s.direction = sample_world(world, q.n, q.transmits, u);
    s.pdf_sa = world_direction_pdf(world, q.n, q.transmits, s.direction) * probability;
    if (!(s.pdf_sa > 0.0f)) return s;
    s.kind = EmitterKind::WORLD;
    s.mis = true;
    s.distance = INFINITE_DISTANCE;
    s.radiance = {1.0f, 1.0f, 1.0f};
    s.point = s.direction;
    s.normal = -s.direction;
    s.visibility = world.visibility;
    s.lightgroup = world.lightgroup;
    s.cast_shadow = true;
    return s;
}

// One among all emitters.
struct LightChoice {
    EmitterKind kind;   // NONE_: none
    float probability;
    u32 lamp;           // LAMP
    Emitter emitter;    // TRIANGLE
    float u_select;     // the number that chose it
};

LUCH_FN LightChoice no_light_choice(float u_select) {
    return {EmitterKind::NONE_, 0.0f, NONE, {NONE, NONE, NONE, NONE}, u_select};
}

LUCH_FN LightChoice choose_source(const LightsView& lights, const LightQuery& q, float u_select, Vec2 u) {
    LightChoice c = no_light_choice(u_select);
    GroupShares shares;
    group_shares(lights, q, &shares);
    if (!(shares.local + shares.suns + shares.world > 0.0f)) return c;
    constexpr bool local_lights = plan::LAMPS || plan::EMISSIVE_MESHES;
    if (local_lights && u_select < shares.local) {
        EmitterChoice choice = choose_local(lights, q, &shares, min_f(u_select / shares.local, BELOW_ONE), u);
        if (choice.emitter == NONE) return c;
        c.emitter = lights.emitters[choice.emitter];
        c.lamp = c.emitter.lamp;
        c.probability = choice.probability * shares.local;
        c.kind = plan::LAMPS && c.lamp != NONE ? EmitterKind::LAMP
                                               : (plan::EMISSIVE_MESHES ? EmitterKind::TRIANGLE : EmitterKind::NONE_);
        return c;
    }
    u_select -= shares.local;
    // The last group takes what rounding leaves over.
    if (plan::SUNS && shares.suns > 0.0f && (u_select < shares.suns || !(shares.world > 0.0f))) {
        EmitterChoice choice = choose_sun(lights, q, min_f(u_select / shares.suns, BELOW_ONE));
        if (choice.emitter == NONE) return c;
        c.kind = EmitterKind::LAMP;
        c.lamp = lights.suns[choice.emitter];
        c.probability = choice.probability * shares.suns;
        return c;
    }
    if (!plan::WORLD_SAMPLING || !(shares.world > 0.0f)) return c;
    c.kind = EmitterKind::WORLD;
    c.probability = shares.world;
    return c;
}

LUCH_FN LightSample sample_source(const SceneView& scene, const LightChoice& c, const LightQuery& q, Vec2 u,
                                  float time) {
    const LightsView& lights = *scene.lights;
    if ((plan::LAMPS || plan::SUNS) && c.kind == EmitterKind::LAMP)
        return sample_chosen_lamp(lights, c.lamp, q, c.probability, u);
    if (plan::EMISSIVE_MESHES && c.kind == EmitterKind::TRIANGLE)
        return sample_chosen_triangle(scene, c.emitter, q, c.probability, cluster_unit(c.u_select, u), u, time);
    if (plan::WORLD_SAMPLING && c.kind == EmitterKind::WORLD)
        return sample_chosen_world(lights.world, q, c.probability, u);
    return no_light_sample();
}

LUCH_FN_SLOW LightSample sample_light(const SceneView& scene, Vec3 p, Vec3 n, bool transmits, float u_select, Vec2 u,
                                      float time = SHUTTER_MIDDLE) {
    LightQuery q = make_light_query(p, n, transmits);
    return sample_source(scene, choose_source(*scene.lights, q, u_select, u), q, u, time);
}

// ---- densities for rays that found an emitter ----------------------------------------------------

LUCH_FN_SLOW float pdf_triangle(const SceneView& scene, Vec3 p, Vec3 n, bool transmits, u32 instance, u32 prim,
                                Vec3 direction, float distance, float time = SHUTTER_MIDDLE) {
    const LightsView& lights = *scene.lights;
    if (lights.emitter_count == 0u) return 0.0f;
    // Spheres and curves are met, never chosen.
    if (!is_triangle(scene.meshes[scene.instances[instance].mesh], prim)) return 0.0f;
    const InstanceLight& light = lights.instances[instance];
    u32 emitter = light.cluster;
    float share = 1.0f;
    if (emitter != NONE) {
        const float* cdf = lights.cluster_cdf + light.cdf + prim;
        share = cdf[1] - cdf[0];
    } else if (light.triangles != NONE) {
        emitter = lights.triangle_emitters[static_cast<u64>(light.triangles) + prim];
    }
    if (emitter == NONE || !(share > 0.0f)) return 0.0f;
    WorldTriangle triangle = make_world_triangle(scene, instance, prim, p, time);
    if (!triangle.sends) return 0.0f;
    // From p itself: a ray that went straight through surfaces began its last piece elsewhere.
    float along = abs_f(dot(triangle.cone.unit_normal, direction));
    if (along > 0.0f) distance = abs_f(triangle.cone.height) / along;
    LightQuery q = make_light_query(p, n, transmits);
    GroupShares shares;
    group_shares(lights, q, &shares);
    if (!(shares.local > 0.0f)) return 0.0f;
    return shares.local * local_probability(lights, q, emitter) * share * triangle_cone_pdf(triangle.cone, distance);
}

LUCH_FN_SLOW float pdf_lamp(const SceneView& scene, Vec3 p, Vec3 n, bool transmits, const LampHit& hit,
                            Vec3 direction) {
    const LightsView& lights = *scene.lights;
    const LampView& lamp = lights.lamps[hit.lamp];
    if (!lamp.mis) return 0.0f;
    LightQuery q = make_light_query(p, n, transmits);
    GroupShares shares;
    group_shares(lights, q, &shares);
    // From p itself: a ray that went straight through surfaces began its last piece elsewhere.
    float distance = is_sun(lamp) ? INFINITE_DISTANCE : intersect_lamp(lamp, p, direction);
    float pdf = lamp_pdf(lamp, p, n, transmits, direction, distance > 0.0f ? distance : hit.t);
    if (is_sun(lamp)) return pdf * shares.suns * sun_probability(lights, q, lamp.emitter);
    if (lamp.emitter == NONE || !(shares.local > 0.0f)) return 0.0f;
    return pdf * shares.local * local_probability(lights, q, lamp.emitter);
}

LUCH_FN_SLOW float pdf_world(const SceneView& scene, Vec3 p, Vec3 n, bool transmits, Vec3 direction) {
    const LightsView& lights = *scene.lights;
    if (!plan::WORLD_SAMPLING || !lights.world.present || !(lights.world.irradiance > 0.0f)) return 0.0f;
    GroupShares shares;
    group_shares(lights, make_light_query(p, n, transmits), &shares);
    if (!(shares.world > 0.0f)) return 0.0f;
    return shares.world * world_direction_pdf(lights.world, n, transmits, direction);
}

}  // namespace luch

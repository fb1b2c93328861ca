// Lamps of finite size as rays see them: a wide tree of boxes over them, tested sixteen at a time.
#pragma once
#include "luch/light/lamp.h"
#include "luch/math/bounds.h"

namespace luch {

inline constexpr int LAMP_BOX_WIDTH = 16;
inline constexpr u32 BOX_IS_LAMP = 0x80000000u;
inline constexpr int LAMP_BOX_STACK = 64;  // nodes not yet visited: 16 per level, far fewer in practice

struct alignas(64) LampBoxNode {
    float low_x[LAMP_BOX_WIDTH], low_y[LAMP_BOX_WIDTH], low_z[LAMP_BOX_WIDTH];
    float high_x[LAMP_BOX_WIDTH], high_y[LAMP_BOX_WIDTH], high_z[LAMP_BOX_WIDTH];  // empty lanes: high < low
    u32 child[LAMP_BOX_WIDTH];  // node, or lamp | BOX_IS_LAMP
};

// Bit per lane whose box the ray's line meets somewhere in [0, t_max], boxes padded by the host.
LUCH_FN u32 hit_lamp_boxes(const LampBoxNode& node, Vec3 origin, Vec3 inverse, float t_max) {
    u32 mask = 0;
    for (int i = 0; i < LAMP_BOX_WIDTH; ++i) {
        float ax = (node.low_x[i] - origin.x) * inverse.x, bx = (node.high_x[i] - origin.x) * inverse.x;
        float ay = (node.low_y[i] - origin.y) * inverse.y, by = (node.high_y[i] - origin.y) * inverse.y;
        float az = (node.low_z[i] - origin.z) * inverse.z, bz = (node.high_z[i] - origin.z) * inverse.z;
        float near = max_f(max_f(min_f(ax, bx), min_f(ay, by)), max_f(min_f(az, bz), 0.0f));
        float far = min_f(min_f(max_f(ax, bx), max_f(ay, by)), min_f(max_f(az, bz), t_max));
        // Bits, not bytes: lanes of one width let the loop take the widest vectors.
        u32 bit = near <= far * LAMP_SLAB_UP ? 1u << i : 0u;
        mask |= node.low_x[i] <= node.high_x[i] ? bit : 0u;
    }
    return mask;
}

LUCH_FN_SLOW void try_lamp(const LightsView& lights, u32 index, const Ray& ray, u32 ray_kind, LampHit* hit) {
    const LampView& lamp = lights.lamps[index];
    if ((lamp.visibility & ray_kind) == 0u || !(lamp.mis || (ray_kind & RAY_CAMERA) != 0u)) return;
    float t = intersect_lamp(lamp, ray.origin, ray.direction);
    if (t > ray.t_min && t <= ray.t_max && (t < hit->t || (t == hit->t && index < hit->lamp))) {
        hit->t = t;
        hit->lamp = index;
    }
}

LUCH_FN_SLOW void finish_lamp_hit(const LampView& lamp, Vec3 origin, Vec3 direction, LampHit* hit) {
    Vec3 point = origin + direction * hit->t;
    hit->normal = -direction;
    if (is_round(lamp) && lamp.kind == LampKind::SPHERE) hit->normal = normalize_or(point - lamp.position, -direction);
    if (is_area(lamp)) hit->normal = lamp.direction;
    bool inside =
        is_round(lamp) && lamp.kind == LampKind::SPHERE && length_squared(origin - lamp.position) <= sqr(lamp.radius);
    hit->radiance = inside ? lamp.radiance : lamp_radiance_towards(lamp, -direction);
    if constexpr (!plan::LAMP_PROGRAMS) return;
    Vec2 uv = lamp_parametric(lamp, point, hit->normal, -direction);
    hit->u = uv.x;
    hit->v = uv.y;
}

LUCH_FN LampHit no_lamp_hit() { return {NONE, INFINITE_DISTANCE, {0.0f, 0.0f, 0.0f}, 0.0f, 0.0f, {0.0f, 0.0f, 1.0f}}; }

LUCH_FN_SLOW LampHit closest_lamp(const SceneView& scene, const Ray& ray, u32 ray_kind) {
    const LightsView& lights = *scene.lights;
    LampHit hit = no_lamp_hit();
    if ((lights.hittable & ray_kind) == 0u || lights.box_count == 0u) return hit;
    Vec3 d = ray.direction;
    Vec3 inverse = {1.0f / d.x, 1.0f / d.y, 1.0f / d.z};
    u32 stack[LAMP_BOX_STACK];
    int size = 0;
    stack[size++] = 0u;
    while (size > 0) {
        const LampBoxNode& node = lights.boxes[stack[--size]];
        u32 mask = hit_lamp_boxes(node, ray.origin, inverse, min_f(hit.t, ray.t_max));
        while (mask != 0u) {
            int lane = lowest_bit(mask);
            mask &= mask - 1u;
            u32 child = node.child[lane];
            if (child & BOX_IS_LAMP)
                try_lamp(lights, child & ~BOX_IS_LAMP, ray, ray_kind, &hit);
            else if (size < LAMP_BOX_STACK)
                stack[size++] = child;
        }
    }
    if (hit.lamp != NONE) finish_lamp_hit(lights.lamps[hit.lamp], ray.origin, d, &hit);
    return hit;
}

// What a ray that leaves the scene sees of the sun-th sun.
LUCH_FN_SLOW LampHit sun_hit(const SceneView& scene, u32 sun, Vec3 direction, u32 ray_kind) {
    LampHit hit = no_lamp_hit();
    u32 index = scene.lights->suns[sun];
    const LampView& lamp = scene.lights->lamps[index];
    if ((lamp.visibility & ray_kind) == 0u || !(lamp.mis || (ray_kind & RAY_CAMERA) != 0u) || lamp.delta) return hit;
    // By the chord: the cosine of half a degree has no digits left.
    if (!(length_squared(direction + lamp.direction) <= 2.0f * lamp.one_minus_cos_half_angle)) return hit;
    hit.lamp = index;
    hit.radiance = lamp.radiance;
    hit.normal = -direction;
    if constexpr (!plan::LAMP_PROGRAMS) return hit;
    Vec2 uv = lamp_parametric(lamp, direction, hit.normal, -direction);
    hit.u = uv.x;
    hit.v = uv.y;
    return hit;
}

}  // namespace luch

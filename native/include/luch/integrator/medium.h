// Media: what fills volumes, the same everywhere in them. Which ones a ray is in is a short list beside its path
// (and beside a shadow ray), which exists only where a scene has volumes: surfaces add to it and take away, and
// what overlaps adds up. The world's medium is everywhere and stands in no list.
#pragma once
#include "luch/bsdf/phase.h"
#include "luch/geometry/surface.h"
#include "luch/math/bounds.h"
#include "luch/shade/surface_setup.h"

namespace luch {

struct MediumView {
    Color absorption, emission;   // per metre; emission: radiance
    Color scattering;             // of all its lobes together
    u32 first_lobe, lobe_count;   // into MediaView::lobes
};

// Media at one place at most, beside the world's: what comes on top is left out, as in Cycles.
inline constexpr u32 MAX_MEDIA = 7;

// Between which surfaces: a medium begins and ends with an instance.
struct MediumEntry {
    u32 instance, medium;
};

struct MediumStack {
    u32 count, unused;
    MediumEntry entries[MAX_MEDIA];
};

struct MediaView {
    const MediumView* media;
    const PhaseLobe* lobes;
    const float* phase_tables;
    u32 count;
    u32 world;             // everywhere; NONE: nothing
    MediumStack camera;    // at camera_position
    Vec3 camera_position;  // world
    u32 last_turn_matters; // 1: a path may meet light that is never sampled: an even world, a glowing medium
    u32 camera_walks;      // 1: on the way from there to where a camera's ray begins, there may be borders
};

// Per metre, of all media at a place. extinction: absorption and scattering.
struct MediumSum {
    Color extinction, scattering, emission;
};

LUCH_FN bool is_in_medium(const MediaView& media, const MediumStack& stack) {
    return stack.count > 0u || media.world != NONE;
}

// Calls visit(medium, instance) for each medium at a place; the world's has instance NONE.
template <class Visit>
LUCH_FN void for_each_medium(const MediaView& media, const MediumStack& stack, Visit&& visit) {
    if (media.world != NONE) visit(media.media[media.world], NONE);
    for (u32 i = 0; i < stack.count; ++i) visit(media.media[stack.entries[i].medium], stack.entries[i].instance);
}

LUCH_FN MediumSum sum_media(const MediaView& media, const MediumStack& stack) {
    MediumSum sum{};
    for_each_medium(media, stack, [&](const MediumView& medium, u32) {
        sum.extinction += medium.absorption + medium.scattering;
        sum.scattering += medium.scattering;
        sum.emission += medium.emission;
    });
    return sum;
}

// exp(-x) with x = coefficient * distance, also where one is 0 and the other infinite.
LUCH_FN float transmitted(float coefficient, float distance) {
    return coefficient > 0.0f ? exp_f(-min_f(coefficient * distance, 200.0f)) : 1.0f;
}
LUCH_FN Color transmitted(Color extinction, float distance) {
    return {transmitted(extinction.x, distance), transmitted(extinction.y, distance),
            transmitted(extinction.z, distance)};
}

LUCH_FN Color media_transmittance(const MediaView& media, const MediumStack& stack, float distance) {
    if (!is_in_medium(media, stack)) return make_vec3(1.0f);
    return transmitted(sum_media(media, stack).extinction, distance);
}

// The integral of transmitted(coefficient, t) over the distance, (1 - exp(-x)) / coefficient: without the
// cancellation of small x by their series (the next term is below 1e-8 of the sum), and 0 where it would be endless.
LUCH_FN float transmitted_length(float coefficient, float distance) {
    float x = coefficient * distance;
    if (!(x > SERIES_BELOW)) {
        if (!finite_f(distance)) return 0.0f;
        return distance * (1.0f - x * (0.5f - x * (1.0f / 6.0f - x * (1.0f / 24.0f))));
    }
    return (1.0f - transmitted(coefficient, distance)) / coefficient;
}
LUCH_FN Color transmitted_length(Color extinction, float distance) {
    return {transmitted_length(extinction.x, distance), transmitted_length(extinction.y, distance),
            transmitted_length(extinction.z, distance)};
}

// The side of a surface that its medium is not on: unit, of a triangle or a sphere.
LUCH_FN Vec3 border_normal(const SceneView& scene, const Hit& hit, const SurfacePoint& spot, float time) {
    InstanceView moved;
    const InstanceView& instance = instance_at_time(scene, hit.instance, time, &moved);
    if (!is_triangle(scene.meshes[instance.mesh], hit.prim)) return spot.outward;
    return world_face_normal(instance, triangle_at(scene, instance, hit.prim, time));
}

// Whether the surface is nothing but the border of a volume.
LUCH_FN bool is_border(const SceneView& scene, const Hit& hit) {
    return scene.materials[material_at(scene, hit.instance, hit.prim)].only_volume;
}

// A ray passes the border of an instance's medium.
LUCH_FN void enter_medium(MediumStack& stack, u32 instance, u32 medium) {
    for (u32 i = 0; i < stack.count; ++i)
        if (stack.entries[i].instance == instance && stack.entries[i].medium == medium) return;
    if (stack.count < MAX_MEDIA) stack.entries[stack.count++] = {instance, medium};
}
LUCH_FN void leave_medium(MediumStack& stack, u32 instance, u32 medium) {
    for (u32 i = 0; i < stack.count; ++i) {
        if (stack.entries[i].instance != instance || stack.entries[i].medium != medium) continue;
        for (--stack.count; i < stack.count; ++i) stack.entries[i] = stack.entries[i + 1u];
        return;
    }
}

// A ray goes through a surface. from_behind: it came from the side that the medium is on. Spheres and hair hold none: their
// inside is not there for rays.
LUCH_FN void cross_border(const SceneView& scene, MediumStack& stack, u32 instance, u32 prim, bool from_behind) {
    u32 medium = scene.materials[material_at(scene, instance, prim)].medium;
    if (medium == NONE || !is_triangle(scene.meshes[scene.instances[instance].mesh], prim)) return;
    if (from_behind)
        leave_medium(stack, instance, medium);
    else
        enter_medium(stack, instance, medium);
}

// Scattering into `after` of light that goes on in direction `before`: sum of coefficient x phase function, per metre
// and steradian. *pdf_sa: density with which sample_media_phase finds that direction.
LUCH_FN_SLOW Color eval_media_phase(const MediaView& media, const MediumStack& stack, Vec3 before, Vec3 after,
                                    float* pdf_sa) {
    Color value = make_vec3(0.0f);
    float weighted = 0.0f, sum = 0.0f;
    for_each_medium(media, stack, [&](const MediumView& medium, u32) {
        for (u32 i = 0; i < medium.lobe_count; ++i) {
            const PhaseLobe& lobe = media.lobes[medium.first_lobe + i];
            float density = eval_phase(lobe, media.phase_tables, before, after), weight = average(lobe.sigma_s);
            value += lobe.sigma_s * density;
            weighted += weight * density;
            sum += weight;
        }
    });
    *pdf_sa = sum > 0.0f ? weighted / sum : 0.0f;
    return value;
}

// A lobe in proportion to its mean coefficient, then a direction of its. u: two numbers for the direction, one for
// the choice.
LUCH_FN_SLOW Vec3 sample_media_phase(const MediaView& media, const MediumStack& stack, Vec3 before, Vec3 u) {
    float target = u.z * average(sum_media(media, stack).scattering), running = 0.0f;
    const PhaseLobe* chosen = nullptr;
    for_each_medium(media, stack, [&](const MediumView& medium, u32) {
        for (u32 i = 0; i < medium.lobe_count; ++i) {
            const PhaseLobe& lobe = media.lobes[medium.first_lobe + i];
            float weight = average(lobe.sigma_s);
            // The last one takes what rounding leaves over.
            if (weight > 0.0f && (!chosen || running <= target)) chosen = &lobe;
            running += weight;
        }
    });
    return chosen ? sample_phase(*chosen, media.phase_tables, before, {u.x, u.y}) : before;
}

}  // namespace luch

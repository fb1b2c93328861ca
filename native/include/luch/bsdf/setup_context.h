// What every closure's setup is told about the shading point, and how a lobe joins the list.
#pragma once
#include "luch/bsdf/closure.h"
#include "luch/bsdf/path_flag.h"
#include "luch/math/bounds.h"
#include "luch/math/fn.h"

namespace luch {

struct SetupContext {
    Vec3 n;    // interpolated shading normal, unit, on the side of the ray
    Vec3 ng;   // geometric normal, unit, on the side of the ray
    Vec3 wo;   // unit, towards where the ray came from
    u32 path_flags = 0;               // PathFlag
    bool caustics_reflective = true;  // the scene's switches; they matter after a diffuse bounce
    bool caustics_refractive = true;
    bool bump_correction = true;      // the material's Bump Map Correction
    bool own_normal = false;          // normals are the surface's own (displacement shown as bump): no bump on it
    float subsurface_min_radius = 0.0f;  // metres; what scatters over less is diffuse (bsdf/subsurface.h)
};

LUCH_FN bool allows_reflective_caustics(const SetupContext& c) {
    return c.caustics_reflective || !(c.path_flags & PATH_DIFFUSE);
}
LUCH_FN bool allows_refractive_caustics(const SetupContext& c) {
    return c.caustics_refractive || !(c.path_flags & PATH_DIFFUSE);
}
// Only emission or only transparency is wanted: lobes are not kept.
LUCH_FN bool wants_lobes(const SetupContext& c) {
    return !(c.path_flags & (PATH_EMISSION_ONLY | PATH_TRANSPARENT_ONLY));
}

LUCH_FN void clear_closures(ClosureSet& set) {
    set.count = 0;
    set.emission = set.transparent = make_vec3(0.0f);
    set.holdout = 0.0f;
    set.n_smooth = make_vec3(0.0f, 0.0f, 1.0f);
}

// A lobe of this weight, or false where it is too weak. A weight that is not a number is no lobe.
LUCH_FN bool start_lobe(Lobe& lobe, LobeType type, Color weight, Vec3 normal, const SetupContext& c) {
    lobe.weight = max_v(weight, make_vec3(0.0f));
    lobe.sample_weight = average(lobe.weight);
    if (!(lobe.sample_weight >= LOBE_WEIGHT_CUTOFF) || !finite_f(lobe.sample_weight)) return false;
    lobe.type = type;
    lobe.fresnel = Fresnel::NONE_;
    lobe.distribution = Distribution::GGX;
    bool bumped = !c.own_normal && (normal.x != c.n.x || normal.y != c.n.y || normal.z != c.n.z);
    u32 flags = !bumped ? 0u : (c.bump_correction ? LOBE_BUMPED | LOBE_SOFTENED : u32(LOBE_BUMPED));
    lobe.flags = static_cast<u8>(flags);
    lobe.normal = normal;
    lobe.alpha_x = lobe.alpha_y = 1.0f;
    lobe.ior = lobe.energy_scale = 1.0f;
    lobe.thin_film_thickness = 0.0f;
    return true;
}

// Adds a finished lobe. In a full list the least likely lobe gives way.
LUCH_FN void add_lobe(ClosureSet& set, const Lobe& lobe, const SetupContext& c) {
    set.n_smooth = c.n;
    if (!wants_lobes(c) || !(lobe.sample_weight > 0.0f)) return;
    int slot = set.count;
    if (slot == plan::MOST_LOBES) {
        slot = 0;
        for (int i = 1; i < plan::MOST_LOBES; ++i)
            if (set.lobes[i].sample_weight < set.lobes[slot].sample_weight) slot = i;
        if (!(lobe.sample_weight > set.lobes[slot].sample_weight)) return;
    } else {
        ++set.count;
    }
    set.lobes[slot] = lobe;
}

// The closure's own normal input made unit; an unusable one falls back to the shading normal.
LUCH_FN Vec3 closure_normal(Vec3 normal, const SetupContext& c) { return normalize_or(normal, c.n); }

// Lifts a bumped normal towards the geometric one just so far that the mirror direction leaves the
// surface at no less than `threshold` (the cosine with ng). Solves for the lifted normal's height z
// over ng in the plane of both: 4 a z^4 - 2 b z^2 + q = 0, from dot(reflect(wo, n'), ng) = threshold.
LUCH_FN Vec3 lift_specular_normal(Vec3 normal, Vec3 ng, Vec3 wo) {
    float height = dot(wo, ng);
    float threshold = min_f(0.9f * height, LEAST_MIRROR_HEIGHT);  // a ray may leave as flat as it came
    if (dot(ng, reflect(wo, normal)) >= threshold) return normal;
    Vec3 side = normalize_or(normal - ng * dot(normal, ng), normal);
    float across = dot(wo, side);
    float a = sqr(across) + sqr(height);
    float b = 2.0f * (a + height * threshold);
    float q = sqr(threshold + height);
    float root = safe_sqrt(b * b - 4.0f * a * q);
    if (!(a > 0.0f)) return ng;  // wo is perpendicular to both
    float z2 = clamp_f(0.25f * (across < 0.0f ? b + root : b - root) / a, 0.0f, 1.0f);
    return side * sqrt_f(1.0f - z2) + ng * sqrt_f(z2);
}
LUCH_FN Vec3 specular_normal(Vec3 normal, const SetupContext& c) {
    bool flat = normal.x == c.ng.x && normal.y == c.ng.y && normal.z == c.ng.z;
    return !c.bump_correction || flat ? normal : lift_specular_normal(normal, c.ng, c.wo);
}

}  // namespace luch

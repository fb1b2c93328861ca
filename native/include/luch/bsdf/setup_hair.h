// Setup of the hair nodes.
#pragma once
#include "luch/bsdf/hair_fibre.h"
#include "luch/bsdf/hair_lobes.h"
#include "luch/bsdf/setup_context.h"
#include "luch/math/bounds.h"

namespace luch {

enum class HairColor : u8 { ABSORPTION, MELANIN, REFLECTANCE };

// Principled Hair's inputs under Blender's names.
struct PrincipledHairParams {
    HairColor parametrization = HairColor::REFLECTANCE;
    Color color = {0.017513f, 0.005763f, 0.002059f};
    float melanin = 0.8f, melanin_redness = 1.0f;
    Color tint = {1.0f, 1.0f, 1.0f};
    Vec3 absorption = {0.245531f, 0.52f, 1.365f};  // per radius
    float roughness = 0.3f, radial_roughness = 0.3f, coat = 0.0f;
    float ior = 1.55f, offset = 0.0349066f;        // of the scales, radians
    float random_color = 0.0f, random_roughness = 0.0f, random = 0.5f;
};

// What the fibre is to a ray: unit; the normal is that of the round fibre, on the side of the ray.
struct FibreSurface {
    Vec3 normal, tangent;
};

// Absorption that gives a mass of fibres this colour (Chiang et al. 2016, equation 9).
LUCH_FN Color absorption_of_color(Color color, float radial_roughness) {
    float inverse = 1.0f / fibre_albedo_scale(radial_roughness);
    Color c = max_v(color, make_vec3(1e-30f));  // black absorbs all, in finite numbers
    return {sqr(log_f(c.x) * inverse), sqr(log_f(c.y) * inverse), sqr(log_f(c.z) * inverse)};
}
// Of the two pigments of hair, by concentration (d'Eon et al. 2011).
LUCH_FN Color absorption_of_pigments(float eumelanin, float pheomelanin) {
    return make_vec3(0.506f, 0.841f, 1.653f) * eumelanin + make_vec3(0.343f, 0.733f, 1.924f) * pheomelanin;
}
LUCH_FN Color fibre_absorption(const PrincipledHairParams& p, float radial_roughness) {
    if (p.parametrization == HairColor::ABSORPTION) return p.absorption;
    if (p.parametrization == HairColor::REFLECTANCE) return absorption_of_color(p.color, radial_roughness);
    float melanin = p.melanin * (1.0f + 2.0f * (p.random - 0.5f) * saturate_f(p.random_color));
    melanin = -log_f(max_f(1.0f - melanin, LIGHTEST_HAIR));  // 0..1 looks linear
    return absorption_of_pigments(melanin * (1.0f - p.melanin_redness), melanin * p.melanin_redness) +
           absorption_of_color(p.tint, radial_roughness);
}

LUCH_FN float power_20(float x) {
    float x2 = sqr(x), x4 = sqr(x2), x16 = sqr(sqr(x4));
    return x16 * x4;
}
// Roughness to variance along the fibre, and to the logistic's scale around it (Chiang et al. 2016, equations 7, 8).
LUCH_FN float variance_along(float r) { return sqr(0.726f * r + 0.812f * sqr(r) + 3.7f * power_20(r)); }
LUCH_FN float scale_around(float r) {
    constexpr float root_of_pi_over_8 = 0.626657069f;
    return (0.265f * r + 1.194f * sqr(r) + 5.372f * power_20(r) * sqr(r)) * root_of_pi_over_8;
}

LUCH_FN_SLOW void setup_principled_hair(ClosureSet& set, Color weight, const PrincipledHairParams& p,
                                        const FibreSurface& surface, const SetupContext& c) {
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::HAIR_FIBRE, weight, c.n, c)) return;
    float random = 1.0f + 2.0f * (p.random - 0.5f) * p.random_roughness, radial = p.radial_roughness * random;
    float roughness = clamp_f(p.roughness * random, FIBRE_MIN_ROUGHNESS, 1.0f);
    lobe.ior = clamp_f(p.ior, FIBRE_SMALLEST_IOR, FIBRE_LARGEST_IOR);
    lobe.c0 = max_v(fibre_absorption(p, radial), make_vec3(0.0f));
    lobe.alpha_x = variance_along(roughness);
    lobe.alpha_y = scale_around(clamp_f(radial, FIBRE_MIN_ROUGHNESS, 1.0f));
    float coat = variance_along(clamp_f((1.0f - saturate_f(p.coat)) * roughness, FIBRE_MIN_ROUGHNESS, 1.0f));
    lobe.tangent = surface.tangent;
    Vec3 t, b;
    make_frame(surface.tangent, &t, &b);
    float h = -dot(surface.normal, normalize_or(cross(surface.tangent, c.wo), t));
    lobe.c1 = {coat, -p.offset, clamp_f(h, -1.0f, 1.0f)};
    add_lobe(set, lobe, c);
}

// tangent: unit; offset in radians.
LUCH_FN_SLOW void setup_hair(ClosureSet& set, Color weight, bool transmission, float offset, float roughness_along,
                             float roughness_around, Vec3 tangent, const SetupContext& c) {
    Lobe lobe;
    LobeType type = transmission ? LobeType::HAIR_TRANSMISSION : LobeType::HAIR_REFLECTION;
    if (!start_lobe(lobe, type, weight, specular_normal(c.n, c), c)) return;
    lobe.flags = 0;  // no bump reaches it
    lobe.alpha_x = clamp_f(roughness_along, FIBRE_MIN_ROUGHNESS, 1.0f);
    lobe.alpha_y = clamp_f(roughness_around, FIBRE_MIN_ROUGHNESS, 1.0f);
    lobe.extra = -offset;
    lobe.tangent = tangent;
    add_lobe(set, lobe, c);
}

}  // namespace luch

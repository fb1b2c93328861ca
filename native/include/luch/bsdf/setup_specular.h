// Setup of the glossy, metallic, glass and refraction nodes.
#pragma once
#include "luch/bsdf/ashikhmin_shirley.h"
#include "luch/bsdf/params.h"
#include "luch/bsdf/setup_context.h"
#include "luch/math/bounds.h"

namespace luch {

// NaN: the smallest.
LUCH_FN float valid_ior(float ior) { return clamp_f(ior, SMALLEST_IOR, LARGEST_IOR); }

// Puts back the light that one bounce between facets loses. mean_fresnel: mean reflectance of one
// bounce over the hemisphere; the bounces beyond the first are tinted by it.
// Source: Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks", appendix.
LUCH_FN void compensate_energy(Lobe& lobe, Vec3 wo, Color mean_fresnel) {
    // Facets between equal media do not exist: straight light loses nothing that could be put back.
    if (plan::TRANSMISSION && lobe.type == LobeType::MICROFACET_GLASS && abs_f(lobe.ior - 1.0f) < STRAIGHT_IOR) return;
    float mu = dot(wo, lobe.normal), roughness = table_roughness(lobe.alpha_x, lobe.alpha_y);
    Albedo e = plan::TRANSMISSION && lobe.type == LobeType::MICROFACET_GLASS ? glass_albedo(roughness, mu, lobe.ior)
                                                                             : reflection_albedo(roughness, mu);
    float lost = (1.0f - e.directional) / e.directional;
    lobe.energy_scale = 1.0f + lost;
    const Color one = make_vec3(1.0f);
    if (mean_fresnel.x == 1.0f && mean_fresnel.y == 1.0f && mean_fresnel.z == 1.0f) return;
    Color beyond = mean_fresnel * e.mean / (one - mean_fresnel * (1.0f - e.mean));
    Color darkening = (one + beyond * lost) / lobe.energy_scale;
    lobe.weight *= darkening;
    lobe.sample_weight *= average(darkening);
}

// Choosing a lobe should follow what it sends on. Returns the reflected share.
LUCH_FN Color weigh_by_albedo(Lobe& lobe, Vec3 wo) {
    FresnelTerm albedo = lobe_albedo(lobe, wo);
    lobe.sample_weight *= average(albedo.reflected) + average(albedo.transmitted);
    return albedo.reflected;
}

LUCH_FN void set_roughness(Lobe& lobe, float alpha_x, float alpha_y) {
    lobe.alpha_x = saturate_f(alpha_x);
    lobe.alpha_y = saturate_f(alpha_y);
}
// Turns the tangent by `rotation` (in turns) around `axis` and makes it perpendicular to the normal.
// False: the tangent lies along the normal and gives no direction.
LUCH_FN bool set_tangent(Lobe& lobe, Vec3 tangent, Vec3 axis, float rotation) {
    if (rotation != 0.0f) {
        float c = cos_f(TWO_PI * rotation), s = sin_f(TWO_PI * rotation);
        tangent = tangent * c + cross(axis, tangent) * s + axis * (dot(axis, tangent) * (1.0f - c));
    }
    Vec3 b = cross(lobe.normal, tangent);
    if (!(length_squared(b) > TANGENT_SINE2 * length_squared(tangent)) || !finite_v(b)) return false;
    lobe.tangent = cross(normalize(b), lobe.normal);
    return true;
}
LUCH_FN void make_isotropic(Lobe& lobe, float alpha) { set_roughness(lobe, alpha, alpha); }

// Anisotropy of the principled and metallic nodes: 0 to 1, along the tangent.
LUCH_FN void set_metal_roughness(Lobe& lobe, float roughness, float anisotropy, float rotation, Vec3 tangent,
                                 Vec3 axis) {
    float alpha = sqr(roughness), aspect = sqrt_f(1.0f - 0.9f * anisotropy);
    make_isotropic(lobe, alpha);
    if (plan::ANISOTROPY && anisotropy > 0.0f && !is_zero(tangent) && set_tangent(lobe, tangent, axis, rotation))
        set_roughness(lobe, alpha / aspect, alpha * aspect);
}

LUCH_FN void set_film(Lobe& lobe, float thickness_nm, float film_ior) {
    lobe.thin_film_thickness = thickness_nm;
    lobe.thin_film_ior = valid_ior(film_ior);
}

LUCH_FN_SLOW void setup_glossy(ClosureSet& set, Color weight, const GlossyParams& p, const SetupContext& c) {
    if (!allows_reflective_caustics(c)) return;
    Vec3 n = closure_normal(p.normal, c);
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::MICROFACET_REFLECTION, weight * p.color, specular_normal(n, c), c)) return;
    lobe.ior = 1.0f;
    float alpha = sqr(saturate_f(p.roughness)), a = clamp_f(p.anisotropy, -MOST_ANISOTROPY, MOST_ANISOTROPY);
    make_isotropic(lobe, alpha);
    if (plan::ANISOTROPY && abs_f(a) > LEAST_ANISOTROPY && !is_zero(p.tangent) &&
        set_tangent(lobe, p.tangent, lobe.normal, p.rotation)) {
        float shrink = 1.0f - abs_f(a);
        set_roughness(lobe, a < 0.0f ? alpha / shrink : alpha * shrink, a < 0.0f ? alpha * shrink : alpha / shrink);
    }
    if (plan::ASHIKHMIN_SHIRLEY && p.distribution == Microfacets::ASHIKHMIN_SHIRLEY) {
        lobe.type = LobeType::ASHIKHMIN_SHIRLEY;
        lobe.alpha_x = max_f(lobe.alpha_x, PHONG_MIN_ALPHA);
        lobe.alpha_y = max_f(lobe.alpha_y, PHONG_MIN_ALPHA);
    } else if (p.distribution == Microfacets::BECKMANN) {
        lobe.distribution = Distribution::BECKMANN;
    } else if (p.distribution == Microfacets::MULTI_GGX) {
        compensate_energy(lobe, c.wo, max_v(p.color, make_vec3(0.0f)));
    }
    add_lobe(set, lobe, c);
}

LUCH_FN_SLOW void setup_metallic(ClosureSet& set, Color weight, const MetallicParams& p, const SetupContext& c) {
    if (!allows_reflective_caustics(c)) return;
    const Color none = make_vec3(0.0f), one = make_vec3(1.0f);
    Vec3 n = closure_normal(p.normal, c);
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::MICROFACET_REFLECTION, weight, specular_normal(n, c), c)) return;
    lobe.ior = 1.0f;
    set_metal_roughness(lobe, saturate_f(p.roughness), saturate_f(p.anisotropy), p.rotation, p.tangent, n);
    set_film(lobe, p.thin_film_thickness, p.thin_film_ior);
    if (p.distribution == Microfacets::BECKMANN) lobe.distribution = Distribution::BECKMANN;
    Color mean_fresnel;
    if (plan::CONDUCTORS && p.physical) {
        lobe.fresnel = Fresnel::CONDUCTOR;
        lobe.c0 = max_v(p.ior, none);
        lobe.c1 = max_v(p.extinction, none);
        mean_fresnel = mean_fresnel_conductor(lobe.c0, lobe.c1);
    } else {
        lobe.fresnel = Fresnel::F82_TINT;
        lobe.c0 = min_v(max_v(p.base_color, none), one);
        lobe.c1 = f82_bend_of_tint(lobe.c0, min_v(max_v(p.edge_tint, none), one));
        mean_fresnel = mean_fresnel_f82(lobe.c0, lobe.c1);
    }
    weigh_by_albedo(lobe, c.wo);
    if (p.distribution == Microfacets::MULTI_GGX) compensate_energy(lobe, c.wo, mean_fresnel);
    add_lobe(set, lobe, c);
}

LUCH_FN_SLOW void setup_refraction(ClosureSet& set, Color weight, const RefractionParams& p, const SetupContext& c) {
    if (!allows_refractive_caustics(c)) return;
    Vec3 n = specular_normal(closure_normal(p.normal, c), c);
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::MICROFACET_REFRACTION, weight * p.color, n, c)) return;
    float ior = valid_ior(p.ior);
    lobe.ior = c.path_flags & PATH_BACKFACING ? 1.0f / ior : ior;
    make_isotropic(lobe, sqr(p.roughness));
    if (p.distribution == Microfacets::BECKMANN) lobe.distribution = Distribution::BECKMANN;
    add_lobe(set, lobe, c);
}

// Reflection and refraction in one lobe with the dielectric's own curve, tinted apart.
struct GlassTints {
    Color f0, reflection, transmission;
};
LUCH_FN void prepare_glass(Lobe& lobe, float ior, float alpha, GlassTints tints, const SetupContext& c) {
    bool inside = c.path_flags & PATH_BACKFACING;
    lobe.ior = inside ? 1.0f / ior : ior;
    lobe.fresnel = Fresnel::GENERALIZED_SCHLICK;
    lobe.extra = f0_from_ior(ior);
    lobe.c0 = min_v(max_v(tints.f0, make_vec3(0.0f)), make_vec3(1.0f));
    lobe.c1 = tints.reflection;
    lobe.c2 = tints.transmission;
    make_isotropic(lobe, alpha);
    // From behind, the stack bulk-film-outside is that of film / bulk under an outside of 1.
    if (inside) lobe.thin_film_ior *= lobe.ior;
    weigh_by_albedo(lobe, c.wo);
}
// The tint of the refraction stands for the whole lobe's colour; a lobe that only reflects has its
// own mean.
LUCH_FN Color mean_fresnel_glass(const Lobe& lobe) {
    if (!is_zero(lobe.c2)) return lobe.c2;
    float f0 = f0_from_ior(lobe.ior);
    float place = saturate_f((mean_fresnel_dielectric(lobe.ior) - f0) / (1.0f - f0));
    return lobe.c1 * mix(lobe.c0, make_vec3(1.0f), place);
}

LUCH_FN_SLOW void setup_glass(ClosureSet& set, Color weight, const GlassParams& p, const SetupContext& c) {
    const Color none = make_vec3(0.0f);
    bool reflects = allows_reflective_caustics(c), refracts = allows_refractive_caustics(c);
    if (!reflects && !refracts) return;
    Vec3 n = specular_normal(closure_normal(p.normal, c), c);
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::MICROFACET_GLASS, weight, n, c)) return;
    float ior = valid_ior(p.ior);
    Color color = max_v(p.color, none);
    set_film(lobe, p.thin_film_thickness, p.thin_film_ior);
    GlassTints tints = {make_vec3(f0_from_ior(ior)), reflects ? color : none, refracts ? color : none};
    prepare_glass(lobe, ior, sqr(saturate_f(p.roughness)), tints, c);
    if (p.distribution == Microfacets::BECKMANN) lobe.distribution = Distribution::BECKMANN;
    if (p.distribution == Microfacets::MULTI_GGX) compensate_energy(lobe, c.wo, mean_fresnel_glass(lobe));
    add_lobe(set, lobe, c);
}

}  // namespace luch

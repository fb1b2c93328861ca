// The Principled BSDF of Blender 5: layers from the outside in. Each layer takes its albedo and
// leaves the rest of the weight to what lies under it; metal and glass take their shares by mixing.
//
//   alpha > sheen > coat > (emission) > metal | glass | dielectric specular > diffuse
#pragma once
#include "luch/bsdf/sheen.h"
#include "luch/bsdf/subsurface.h"
#include "luch/bsdf/thin_wall.h"
#include "luch/math/bounds.h"

namespace luch {

// Weight under a layer that sends `albedo` (with its weight) back: as grey as the layer's strongest
// channel, so that the layers below keep their hue.
LUCH_FN Color weight_under(Color albedo, Color weight) {
    Color share = {safe_divide(albedo.x, weight.x), safe_divide(albedo.y, weight.y), safe_divide(albedo.z, weight.z)};
    return weight * saturate_f(1.0f - max_component(share));
}

// The node's inputs in range, and what several layers share.
struct PrincipledSurface {
    const PrincipledParams& p;
    const SetupContext& c;
    Vec3 n, specular_n;    // shading normal; lifted for reflections
    Vec3 coat_n;
    Color base, clamped_base, specular_tint;
    float ior, roughness, film_thickness, film_ior;
};
LUCH_FN PrincipledSurface read_principled(const PrincipledParams& p, const SetupContext& c) {
    const Color none = make_vec3(0.0f);
    Vec3 n = closure_normal(p.normal, c);
    Vec3 coat_n = is_zero(p.coat_normal) ? n : closure_normal(p.coat_normal, c);
    Color base = max_v(p.base_color, none);
    float film_ior = p.thin_film_thickness > FILM_MIN_THICKNESS_NM ? valid_ior(p.thin_film_ior) : 0.0f;
    return {p,
            c,
            n,
            specular_normal(n, c),
            coat_n,
            base,
            min_v(base, make_vec3(1.0f)),
            max_v(p.specular_tint, none),
            valid_ior(p.ior),
            saturate_f(p.roughness),
            p.thin_film_thickness,
            film_ior};
}

LUCH_FN Color layer_sheen(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float amount = max_f(s.p.sheen_weight, 0.0f);
    if (!plan::SHEEN || !(amount > LOBE_WEIGHT_CUTOFF)) return weight;
    Color tint = max_v(s.p.sheen_tint, make_vec3(0.0f));
    Vec3 n = normalize_or(mix(s.n, s.coat_n, saturate_f(s.p.coat_weight)), s.n);
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::SHEEN, amount * tint * weight, n, s.c)) return weight;
    if (!prepare_sheen(lobe, s.c.wo, saturate_f(s.p.sheen_roughness))) return weight;
    add_lobe(set, lobe, s.c);
    return weight_under(lobe.weight, weight);
}

// The coat's colour is its absorption at normal incidence; a slanted way is longer by 1 / cos.
LUCH_FN Color coat_absorption(Color tint, float ior, float amount, float cos_i) {
    float cos_t = safe_sqrt(1.0f - (1.0f - sqr(cos_i)) / sqr(ior));
    float way = 1.0f / max_f(cos_t, SMALLEST_COSINE);
    Color through = {pow_f(tint.x, way), pow_f(tint.y, way), pow_f(tint.z, way)};
    return mix(make_vec3(1.0f), through, amount);
}

LUCH_FN Color layer_coat(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float amount = max_f(s.p.coat_weight, 0.0f);
    if (!plan::COAT || !(amount > LOBE_WEIGHT_CUTOFF)) return weight;
    float ior = clamp_f(s.p.coat_ior, 1.0f, LARGEST_IOR);
    Vec3 n = specular_normal(s.coat_n, s.c);
    Lobe lobe;
    if (allows_reflective_caustics(s.c) && start_lobe(lobe, LobeType::MICROFACET_REFLECTION, amount * weight, n, s.c)) {
        lobe.ior = ior;
        lobe.fresnel = Fresnel::DIELECTRIC;
        make_isotropic(lobe, sqr(saturate_f(s.p.coat_roughness)));
        Color reflected = weigh_by_albedo(lobe, s.c.wo);
        compensate_energy(lobe, s.c.wo, make_vec3(mean_fresnel_dielectric(ior)));
        add_lobe(set, lobe, s.c);
        weight = weight_under(lobe.weight * reflected, weight);
    }
    Color tint = max_v(s.p.coat_tint, make_vec3(0.0f));
    if (tint.x == 1.0f && tint.y == 1.0f && tint.z == 1.0f) return weight;
    return weight * coat_absorption(tint, ior, amount, dot(s.c.wo, n));
}

LUCH_FN Color mix_metal(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float metallic = saturate_f(s.p.metallic);
    if (!plan::METALS || !(metallic > LOBE_WEIGHT_CUTOFF)) return weight;
    Lobe lobe;
    if (allows_reflective_caustics(s.c) &&
        start_lobe(lobe, LobeType::MICROFACET_REFLECTION, metallic * weight, s.specular_n, s.c)) {
        lobe.ior = 1.0f;
        lobe.fresnel = Fresnel::F82_TINT;
        lobe.c0 = s.clamped_base;
        lobe.c1 = f82_bend_of_tint(lobe.c0, min_v(s.specular_tint, make_vec3(1.0f)));
        set_metal_roughness(lobe, s.roughness, saturate_f(s.p.anisotropic), s.p.anisotropic_rotation, s.p.tangent, s.n);
        set_film(lobe, s.film_thickness, s.film_ior);
        weigh_by_albedo(lobe, s.c.wo);
        if (s.p.multiple_scattering) compensate_energy(lobe, s.c.wo, mean_fresnel_f82(lobe.c0, lobe.c1));
        add_lobe(set, lobe, s.c);
    }
    return weight * (1.0f - metallic);
}

LUCH_FN Color mix_glass(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float amount = saturate_f(s.p.transmission_weight);
    if (!plan::TRANSMISSION || !(amount > LOBE_WEIGHT_CUTOFF)) return weight;
    bool reflects = allows_reflective_caustics(s.c), refracts = allows_refractive_caustics(s.c);
    Color through = {sqrt_f(s.clamped_base.x), sqrt_f(s.clamped_base.y), sqrt_f(s.clamped_base.z)};
    Lobe lobe;
    if (!reflects && !refracts) {
    } else if (plan::THIN_WALLS && s.p.thin_wall) {
        ThinGlass sheet = {s.ior, sqr(s.roughness), s.film_thickness, s.film_ior, s.specular_tint, s.clamped_base};
        setup_thin_glass(set, amount * weight, sheet, s.specular_n, s.c);
    } else if (start_lobe(lobe, LobeType::MICROFACET_GLASS, amount * weight, s.specular_n, s.c)) {
        const Color none = make_vec3(0.0f);
        set_film(lobe, s.film_thickness, s.film_ior);
        GlassTints tints = {f0_from_ior(s.ior) * s.specular_tint, reflects ? make_vec3(1.0f) : none,
                            refracts ? through : none};
        prepare_glass(lobe, s.ior, sqr(s.roughness), tints, s.c);
        if (s.p.multiple_scattering) compensate_energy(lobe, s.c.wo, mean_fresnel_glass(lobe));
        add_lobe(set, lobe, s.c);
    }
    return weight * (1.0f - amount);
}

// Index of refraction with Specular IOR Level; *f0: what it reflects straight on.
LUCH_FN float specular_ior(const PrincipledSurface& s, float* f0) {
    float level = max_f(s.p.specular_ior_level, 0.0f);
    *f0 = f0_from_ior(s.ior);
    if (level == 0.5f) return s.ior;
    *f0 *= 2.0f * level;
    float eta = ior_from_f0(*f0);
    return s.ior < 1.0f ? 1.0f / eta : eta;
}
LUCH_FN float specular_ior(const PrincipledSurface& s) {
    float f0;
    return specular_ior(s, &f0);
}

LUCH_FN Color layer_specular(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float f0, eta = specular_ior(s, &f0);
    Lobe lobe;
    if (!allows_reflective_caustics(s.c) || !(eta != 1.0f || s.film_thickness > FILM_MIN_THICKNESS_NM)) return weight;
    if (!start_lobe(lobe, LobeType::MICROFACET_REFLECTION, weight, s.specular_n, s.c)) return weight;
    lobe.ior = eta;
    lobe.fresnel = Fresnel::GENERALIZED_SCHLICK;
    lobe.extra = f0_from_ior(eta);
    lobe.c0 = min_v(f0 * s.specular_tint, make_vec3(1.0f));
    lobe.c1 = make_vec3(1.0f);
    lobe.c2 = make_vec3(0.0f);
    set_metal_roughness(lobe, s.roughness, saturate_f(s.p.anisotropic), s.p.anisotropic_rotation, s.p.tangent, s.n);
    set_film(lobe, s.film_thickness, s.film_ior);
    Color reflected = weigh_by_albedo(lobe, s.c.wo);
    if (s.p.multiple_scattering) compensate_energy(lobe, s.c.wo, mean_fresnel_glass(lobe));
    add_lobe(set, lobe, s.c);
    return weight_under(lobe.weight * reflected, weight);
}

// level_ior: the index that Specular IOR Level asks for.
LUCH_FN void scatter_inside(ClosureSet& set, Color weight, float level_ior, const PrincipledSurface& s) {
    bool skin = s.p.subsurface_method == SubsurfaceMethod::SKIN;
    SubsurfaceParams inside;
    inside.color = s.clamped_base;
    inside.radius = s.p.subsurface_radius;
    inside.ior = skin ? s.p.subsurface_ior : level_ior;
    inside.alpha = sqr(s.roughness);
    inside.anisotropy = s.p.subsurface_anisotropy;
    inside.normal = s.n;
    inside.method = s.p.subsurface_method;
    setup_subsurface(set, weight, inside, s.c);
}

LUCH_FN void base_diffuse(ClosureSet& set, Color weight, const PrincipledSurface& s) {
    float subsurface = saturate_f(s.p.subsurface_weight), roughness = saturate_f(s.p.diffuse_roughness);
    if (subsurface > LOBE_WEIGHT_CUTOFF && plan::THIN_WALLS && s.p.thin_wall) {  // where it is exact
        setup_thin_subsurface(set, s.clamped_base * weight * subsurface, s.p.subsurface_anisotropy, roughness,
                              s.clamped_base, s.n, s.c);
        weight *= 1.0f - subsurface;
    } else if (plan::SUBSURFACE && subsurface > LOBE_WEIGHT_CUTOFF && !is_zero(s.p.subsurface_radius)) {
        scatter_inside(set, weight * subsurface, specular_ior(s), s);
        weight *= 1.0f - subsurface;
    }
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::DIFFUSE, s.base * weight, s.n, s.c)) return;
    if (plan::ROUGH_DIFFUSE && roughness >= OREN_NAYAR_MIN_ROUGHNESS)
        prepare_oren_nayar(lobe, s.base, dot(s.n, s.c.wo), roughness);
    add_lobe(set, lobe, s.c);
}

LUCH_FN_SLOW void setup_principled(ClosureSet& set, Color weight, const PrincipledParams& p, const SetupContext& c) {
    PrincipledSurface s = read_principled(p, c);
    float alpha = saturate_f(p.alpha);
    if (alpha < 1.0f) {
        Color through = weight * (1.0f - alpha);
        if (average(through) >= LOBE_WEIGHT_CUTOFF) set.transparent += through;
        weight *= alpha;
    }
    if (c.path_flags & PATH_TRANSPARENT_ONLY && !p.thin_wall) return;
    weight = layer_sheen(set, weight, s);
    weight = layer_coat(set, weight, s);
    set.emission += weight * p.emission_color * p.emission_strength;
    if (c.path_flags & PATH_EMISSION_ONLY) return;
    weight = mix_metal(set, weight, s);
    weight = mix_glass(set, weight, s);
    weight = layer_specular(set, weight, s);
    base_diffuse(set, weight, s);
}

}  // namespace luch

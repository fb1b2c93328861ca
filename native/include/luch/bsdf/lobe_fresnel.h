// A microfacet lobe's Fresnel term, and the share of light that the lobe as a whole sends on.
//
// How Fresnel's kind uses the lobe:  c0, c1, c2, extra
//   NONE_                none           white reflection, or white refraction but for total reflection
//   DIELECTRIC           none
//   CONDUCTOR            n, k
//   F82_TINT             F0, bend b
//   GENERALIZED_SCHLICK  F0, tint of reflection, tint of refraction; extra: real F0 of ior
#pragma once
#include "luch/bsdf/albedo.h"
#include "luch/bsdf/thin_film.h"
#include "luch/math/bounds.h"
#include "luch/plan.h"

namespace luch {

struct FresnelTerm {
    Color reflected, transmitted;
    float cos_t;  // cosine of the refracted ray, positive; undefined where nothing is transmitted
};

LUCH_FN bool can_reflect(const Lobe& l) { return !plan::TRANSMISSION || l.type != LobeType::MICROFACET_REFRACTION; }
LUCH_FN bool can_transmit(const Lobe& l) {
    return plan::TRANSMISSION && (l.type == LobeType::MICROFACET_REFRACTION || l.type == LobeType::MICROFACET_GLASS);
}
LUCH_FN bool has_film(const Lobe& l) { return plan::THIN_FILM && l.thin_film_thickness > FILM_MIN_THICKNESS_NM; }

// The film's colour is scaled towards the wanted F0 where it is near the real one.
LUCH_FN float scale_film_f0(float f, float f0, float real_f0) {
    float near_f0 = saturate_f((1.0f - f) / (1.0f - real_f0));
    return f * mix_f(1.0f, f0 / real_f0, near_f0);
}

// Reflectance between F0 and 1, where the real dielectric curve says how far.
LUCH_FN Color remapped_dielectric(const Lobe& l, float cos_i, float* cos_t) {
    if (has_film(l)) {
        Color f = film_over_dielectric(l.thin_film_thickness, l.thin_film_ior, l.ior, cos_i, cos_t);
        if (!(l.extra > FILM_LEAST_F0) || (f.x == 1.0f && f.y == 1.0f && f.z == 1.0f)) return f;
        return {scale_film_f0(f.x, l.c0.x, l.extra), scale_film_f0(f.y, l.c0.y, l.extra),
                scale_film_f0(f.z, l.c0.z, l.extra)};
    }
    float place = saturate_f((fresnel_dielectric(cos_i, l.ior, cos_t) - l.extra) / (1.0f - l.extra));
    return l.c0 + (make_vec3(1.0f) - l.c0) * place;
}

LUCH_FN FresnelTerm fresnel_term(const Lobe& l, float cos_i) {
    const Color one = make_vec3(1.0f), none = make_vec3(0.0f);
    FresnelTerm f = {none, none, 1.0f};
    switch (l.fresnel) {
        case Fresnel::GENERALIZED_SCHLICK: {
            Color r = remapped_dielectric(l, cos_i, &f.cos_t);
            f.reflected = r * l.c1;
            f.transmitted = (one - r) * l.c2;
            break;
        }
        case Fresnel::DIELECTRIC:
            if constexpr (!plan::COAT) break;
            f.reflected = make_vec3(fresnel_dielectric(cos_i, l.ior, &f.cos_t));
            f.transmitted = one - f.reflected;
            break;
        case Fresnel::CONDUCTOR:
            if constexpr (!plan::CONDUCTORS) return f;
            f.reflected = has_film(l) ? film_over_metal(l.thin_film_thickness, l.thin_film_ior, l.c0, l.c1, cos_i)
                                      : fresnel_conductor(cos_i, l.c0, l.c1);
            return f;
        case Fresnel::F82_TINT:
            if constexpr (!plan::METALS) return f;
            f.reflected = has_film(l) ? film_over_f82(l.thin_film_thickness, l.thin_film_ior, l.c0, l.c1, cos_i)
                                      : fresnel_f82(cos_i, l.c0, l.c1);
            return f;
        case Fresnel::NONE_:
            f.reflected = one;
            if (can_transmit(l)) f.transmitted = fresnel_dielectric(cos_i, l.ior, &f.cos_t) == 1.0f ? none : one;
            break;
    }
    if (!can_reflect(l)) f.reflected = none;
    if (!can_transmit(l)) f.transmitted = none;
    return f;
}

// Reflected and transmitted share of a white surrounding, without the lobe's weight. The base model
// is taken as lossless; where no table serves, the surface is taken as smooth.
LUCH_FN_SLOW FresnelTerm lobe_albedo(const Lobe& l, Vec3 wo) {
    const Color one = make_vec3(1.0f), none = make_vec3(0.0f);
    float mu = dot(wo, l.normal);
    if (l.flags & LOBE_MIRRORED) return {none, one, 1.0f};
    if (l.type == LobeType::ASHIKHMIN_SHIRLEY) return {one, none, 1.0f};
    float roughness = table_roughness(l.alpha_x, l.alpha_y);
    if (l.fresnel == Fresnel::GENERALIZED_SCHLICK && !has_film(l)) {
        Color r = mix(l.c0, one, dielectric_place(roughness, mu, l.ior));
        return {r * l.c1, (one - r) * l.c2, 1.0f};
    }
    if (plan::METALS && l.fresnel == Fresnel::F82_TINT && !has_film(l))
        return {mix(l.c0, one, metal_place(roughness, mu)), none, 1.0f};
    if (plan::COAT && l.fresnel == Fresnel::DIELECTRIC && l.ior > 1.0f) {
        float r = mix_f(f0_from_ior(l.ior), 1.0f, dielectric_place(roughness, mu, l.ior));
        return {make_vec3(r), can_transmit(l) ? make_vec3(1.0f - r) : none, 1.0f};
    }
    return fresnel_term(l, mu);
}

}  // namespace luch

// Sheets without thickness, as OpenPBR defines them: glass whose inner reflections are summed, and a
// scattering sheet that splits light between its two sides.
#pragma once
#include "luch/bsdf/diffuse.h"
#include "luch/bsdf/setup_specular.h"

namespace luch {

struct ThinGlass {
    float ior, alpha;
    float film_thickness, film_ior;
    Color specular_tint, color;  // tint of F0; colour of light that crosses once at normal incidence
};

// One face of the sheet as a dielectric, seen under cos_i.
LUCH_FN FresnelTerm sheet_face(const ThinGlass& g, float ior, float film_ior, bool reflects, bool refracts,
                               float cos_i) {
    Lobe face;
    face.type = LobeType::MICROFACET_GLASS;
    face.fresnel = Fresnel::GENERALIZED_SCHLICK;
    face.ior = ior;
    face.extra = f0_from_ior(g.ior);
    face.c0 = face.extra * g.specular_tint;
    face.c1 = make_vec3(reflects ? 1.0f : 0.0f);
    face.c2 = make_vec3(refracts ? 1.0f : 0.0f);
    set_film(face, g.film_thickness, film_ior);
    return fresnel_term(face, cos_i);
}

struct SheetShares {
    Color reflected, transmitted;
};
LUCH_FN SheetShares sheet_shares(const ThinGlass& g, bool reflects, bool refracts, float cos_i) {
    const Color none = make_vec3(0.0f), one = make_vec3(1.0f);
    FresnelTerm front = sheet_face(g, g.ior, g.film_ior, reflects, refracts, cos_i), back = front;
    if (is_zero(front.reflected) && is_zero(front.transmitted)) return {none, none};
    if (g.film_thickness > FILM_MIN_THICKNESS_NM)
        back = sheet_face(g, 1.0f / g.ior, g.film_ior / g.ior, reflects, refracts, front.cos_t);
    // Beer's law along the slanted way through the sheet.
    float slant = front.cos_t > 0.0f ? 1.0f / front.cos_t : 0.0f;
    Color once =
        slant > 0.0f ? make_vec3(pow_f(g.color.x, slant), pow_f(g.color.y, slant), pow_f(g.color.z, slant)) : none;
    // Both are geometric series over the reflections inside.
    Color inside = back.reflected * once;
    Color rest = one - inside * inside, across = once * front.transmitted * back.transmitted;
    Color through = {safe_divide(across.x, rest.x), safe_divide(across.y, rest.y), safe_divide(across.z, rest.z)};
    return {front.reflected + through * inside, through};
}

// Two refractions roughen more than one. Kulla and Conty 2017, page 40, with 3.4 for the printed 3.7.
LUCH_FN float thin_transmission_alpha(float alpha, float ior) {
    return saturate_f(alpha * safe_sqrt(3.4f * (ior - 1.0f) * sqr(ior - 0.5f) / (sqr(ior) * ior)));
}

LUCH_FN_SLOW void setup_thin_glass(ClosureSet& set, Color weight, const ThinGlass& g, Vec3 normal,
                                   const SetupContext& c) {
    SheetShares shares =
        sheet_shares(g, allows_reflective_caustics(c), allows_refractive_caustics(c), dot(normal, c.wo));
    Lobe lobe;
    if (start_lobe(lobe, LobeType::MICROFACET_REFLECTION, shares.reflected * weight, normal, c)) {
        lobe.ior = 1.0f;
        make_isotropic(lobe, g.alpha);
        compensate_energy(lobe, c.wo, g.specular_tint);
        add_lobe(set, lobe, c);
    }
    float alpha = thin_transmission_alpha(g.alpha, g.ior);
    Color transmitted = shares.transmitted * weight;
    // A smooth sheet does not bend light: to all but the camera it is a transparent surface.
    if (sqr(alpha) <= MIRROR_ALPHA2 && !(c.path_flags & PATH_CAMERA)) {
        if (average(transmitted) >= LOBE_WEIGHT_CUTOFF) set.transparent += transmitted;
        return;
    }
    if (!start_lobe(lobe, LobeType::MICROFACET_REFLECTION, transmitted, -normal, c)) return;
    lobe.flags = LOBE_MIRRORED;
    lobe.ior = 1.0f;
    make_isotropic(lobe, alpha);
    compensate_energy(lobe, c.wo - normal * (2.0f * dot(c.wo, normal)), make_vec3(1.0f));
    add_lobe(set, lobe, c);
}

// anisotropy -1: all light returns; 1: all goes through.
LUCH_FN_SLOW void setup_thin_subsurface(ClosureSet& set, Color weight, float anisotropy, float roughness, Color color,
                                        Vec3 normal, const SetupContext& c) {
    Color reflected = saturate_f(0.5f * (1.0f - anisotropy)) * weight;
    Color transmitted = saturate_f(0.5f * (1.0f + anisotropy)) * weight;
    bool rough = plan::ROUGH_DIFFUSE && roughness >= OREN_NAYAR_MIN_ROUGHNESS;
    Lobe lobe;
    if (start_lobe(lobe, LobeType::DIFFUSE, reflected, normal, c)) {
        if (rough) prepare_oren_nayar(lobe, color, dot(normal, c.wo), roughness);
        add_lobe(set, lobe, c);
    }
    if (!start_lobe(lobe, LobeType::TRANSLUCENT, transmitted, normal, c)) return;
    if (rough) {
        prepare_oren_nayar(lobe, color, dot(normal, c.wo), roughness);
        lobe.normal = -normal;
        lobe.flags |= LOBE_MIRRORED;
    }
    add_lobe(set, lobe, c);
}

}  // namespace luch

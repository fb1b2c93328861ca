// The list of lobes as the integrator sees it: evaluate, sample, blur, and what the passes show.
#pragma once
#include "luch/bsdf/ashikhmin_shirley.h"
#include "luch/bsdf/bump_shadow.h"
#include "luch/bsdf/diffuse.h"
#include "luch/bsdf/hair_fibre.h"
#include "luch/bsdf/hair_lobes.h"
#include "luch/bsdf/microfacet.h"
#include "luch/bsdf/sheen.h"
#include "luch/bsdf/toon.h"
#include "luch/math/bounds.h"
#include "luch/plan.h"

namespace luch {

LUCH_FN Vec3 mirrored_at(Vec3 w, Vec3 n) { return w - n * (2.0f * dot(w, n)); }

LUCH_FN bool is_diffuse(LobeType t) { return t <= LobeType::SHEEN; }
LUCH_FN bool is_subsurface(LobeType t) { return t >= LobeType::SUBSURFACE && t <= LobeType::SUBSURFACE_DISK; }
LUCH_FN bool is_hair(LobeType t) { return plan::HAIR && t >= LobeType::HAIR_FIBRE && t <= LobeType::HAIR_TRANSMISSION; }
// Of the lobes of hair.
LUCH_FN bool is_fibre(LobeType t) { return plan::FIBRES && (!plan::HAIR_CONES || t == LobeType::HAIR_FIBRE); }

// A lobe's light counts by its kind and, for glass, by the side it leaves on.
LUCH_FN LobeClass lobe_class(const Lobe& lobe, Vec3 wi) {
    switch (lobe.type) {
        case LobeType::DIFFUSE:
        case LobeType::OREN_NAYAR:
        case LobeType::TRANSLUCENT:
        case LobeType::TOON_DIFFUSE:
        case LobeType::SUBSURFACE:
        case LobeType::SUBSURFACE_SKIN:
        case LobeType::SUBSURFACE_LEGACY:
        case LobeType::SUBSURFACE_DISK:
        case LobeType::SHEEN:
            return CLASS_DIFFUSE;
        case LobeType::MICROFACET_REFRACTION:
        case LobeType::HAIR_TRANSMISSION:
            return CLASS_TRANSMISSION;
        case LobeType::MICROFACET_GLASS:
            return dot(lobe.normal, wi) > 0.0f ? CLASS_GLOSSY : CLASS_TRANSMISSION;
        default:
            return lobe.flags & LOBE_MIRRORED ? CLASS_TRANSMISSION : CLASS_GLOSSY;
    }
}

LUCH_FN void add_to_class(BsdfValue& value, LobeClass which, Color light) {
    Color& sum = which == CLASS_DIFFUSE ? value.diffuse : (which == CLASS_GLOSSY ? value.glossy : value.transmission);
    sum += light;
}

LUCH_FN LobeValue eval_lobe_unshadowed(const Lobe& lobe, Vec3 wo, Vec3 wi) {
    switch (lobe.type) {
        case LobeType::DIFFUSE:
            return eval_diffuse(lobe, wi);
        case LobeType::OREN_NAYAR:
            if constexpr (plan::ROUGH_DIFFUSE) return eval_oren_nayar(lobe, wo, wi);
            break;
        case LobeType::TRANSLUCENT:
            return eval_translucent(lobe, wi);
        case LobeType::SHEEN:
            if constexpr (plan::SHEEN) return eval_sheen(lobe, wi);
            break;
        case LobeType::ASHIKHMIN_SHEEN:
            if constexpr (plan::SHEEN) return eval_velvet(lobe, wo, wi);
            break;
        case LobeType::TOON_DIFFUSE:
        case LobeType::TOON_GLOSSY:
            if constexpr (plan::TOON) return eval_toon(lobe, wo, wi);
            break;
        case LobeType::ASHIKHMIN_SHIRLEY:
            if constexpr (plan::ASHIKHMIN_SHIRLEY) return eval_ashikhmin_shirley(lobe, wo, wi);
            break;
        case LobeType::MICROFACET_REFLECTION:
        case LobeType::MICROFACET_REFRACTION:
        case LobeType::MICROFACET_GLASS:
            if constexpr (plan::MICROFACETS) return eval_microfacet(lobe, wo, wi);
            break;
        case LobeType::HAIR_FIBRE:
            if constexpr (plan::FIBRES) return eval_fibre(lobe, wo, wi);
            break;
        case LobeType::HAIR_REFLECTION:
        case LobeType::HAIR_TRANSMISSION:
            if constexpr (plan::HAIR_CONES) return eval_hair(lobe, wo, wi);
            break;
        case LobeType::SUBSURFACE:
        case LobeType::SUBSURFACE_SKIN:
        case LobeType::SUBSURFACE_LEGACY:
        case LobeType::SUBSURFACE_DISK:
        case LobeType::NONE_:
            break;
    }
    return no_value();
}

LUCH_FN LobeValue eval_lobe(const Lobe& lobe, Vec3 n_smooth, Vec3 wo, Vec3 wi) {
    Vec3 seen_from = lobe.flags & LOBE_MIRRORED ? mirrored_at(wo, lobe.normal) : wo;
    LobeValue value = eval_lobe_unshadowed(lobe, seen_from, wi);
    if (lobe.flags & LOBE_BUMPED) value.f *= bump_shadow(lobe, is_diffuse(lobe.type), n_smooth, wi, true);
    return value;
}

// Where no point has more than one lobe there are no loops over them.
LUCH_FN int lobe_count(const ClosureSet& set) { return plan::MOST_LOBES == 1 ? int(set.count != 0) : set.count; }

// Of all lobes: what a lobe's sample_weight is a share of.
LUCH_FN float lobe_weight_sum(const ClosureSet& set) {
    float sum = 0.0f;
    for (int i = 0; i < lobe_count(set); ++i) sum += set.lobes[i].sample_weight;
    return sum;
}

// Light scattered from wi to wo per class, times |cos|; the density of sample_closures choosing wi.
LUCH_FN_SLOW BsdfValue eval_closures(const ClosureSet& set, Vec3 /*n_geometric*/, Vec3 wo, Vec3 wi, float* pdf_sa) {
    BsdfValue value = {};
    float pdf_sum = 0.0f, weight_sum = 0.0f;
    for (int i = 0; i < lobe_count(set); ++i) {
        const Lobe& lobe = set.lobes[i];
        weight_sum += lobe.sample_weight;
        LobeValue v = eval_lobe(lobe, set.n_smooth, wo, wi);
        if (!(v.pdf_sa > 0.0f)) continue;
        add_to_class(value, lobe_class(lobe, wi), v.f * lobe.weight);
        pdf_sum += v.pdf_sa * lobe.sample_weight;
    }
    *pdf_sa = weight_sum > 0.0f ? pdf_sum / weight_sum : 0.0f;
    return value;
}

LUCH_FN LobeSample sample_fibres_or_diffuse(const Lobe& lobe, Vec3 n_outside, Vec3 wo, Vec2 u) {
    LobeSample s = {};
    s.transmitted = lobe.type == LobeType::TRANSLUCENT;
    if (plan::SHEEN && lobe.type == LobeType::SHEEN) {
        s.direction = sample_sheen(lobe, u);
    } else if (plan::SHEEN && lobe.type == LobeType::ASHIKHMIN_SHEEN) {
        s.direction = sample_uniform_around(lobe.normal, u);
    } else if (plan::TOON && (lobe.type == LobeType::TOON_DIFFUSE || lobe.type == LobeType::TOON_GLOSSY)) {
        s.direction = sample_toon(lobe, wo, u);
    } else {
        s.direction = sample_cosine_around(s.transmitted ? -lobe.normal : lobe.normal, u);
    }
    float side = dot(n_outside, s.direction);
    if (s.transmitted ? !(side < 0.0f) : !(side > 0.0f)) return s;
    LobeValue v = eval_lobe_unshadowed(lobe, wo, s.direction);
    s.f = v.f;
    s.pdf_sa = v.pdf_sa;
    return s;
}

LUCH_FN LobeSample sample_lobe(const Lobe& lobe, Vec3 n_geometric, Vec3 wo, float u_side, Vec2 u) {
    bool mirrored = lobe.flags & LOBE_MIRRORED;
    Vec3 outside = mirrored ? -n_geometric : n_geometric;
    Vec3 seen_from = mirrored ? mirrored_at(wo, lobe.normal) : wo;
    LobeSample s;
    if (plan::ASHIKHMIN_SHIRLEY && lobe.type == LobeType::ASHIKHMIN_SHIRLEY) {
        s = sample_ashikhmin_shirley(lobe, outside, seen_from, u);
    } else if (is_hair(lobe.type)) {
        s = is_fibre(lobe.type) ? sample_fibre(lobe, seen_from, u_side, u) : sample_hair(lobe, seen_from, u);
    } else if (plan::MICROFACETS && lobe.type >= LobeType::MICROFACET_REFLECTION) {
        s = sample_microfacet(lobe, outside, seen_from, u_side, u);
    } else {
        s = sample_fibres_or_diffuse(lobe, outside, seen_from, u);
    }
    s.transmitted = s.transmitted || mirrored;
    return s;
}

// Chooses a lobe by its sample weight; *u becomes a fresh number in [0, 1).
LUCH_FN int choose_lobe(const ClosureSet& set, float weight_sum, float* u) {
    float r = *u * weight_sum, before = 0.0f;
    int i = 0;
    for (; i < set.count - 1; ++i) {
        float after = before + set.lobes[i].sample_weight;
        if (r < after) break;
        before = after;
    }
    *u = clamp_f((r - before) / set.lobes[i].sample_weight, 0.0f, BELOW_ONE);
    return i;
}

LUCH_FN_SLOW BsdfSample sample_closures(const ClosureSet& set, Vec3 n_geometric, Vec3 wo, float u_lobe, Vec2 u) {
    BsdfSample out = {};
    if (set.count == 0) return out;
    float weight_sum = lobe_weight_sum(set);
    int chosen = plan::MOST_LOBES > 1 && set.count > 1 ? choose_lobe(set, weight_sum, &u_lobe) : 0;
    const Lobe& lobe = set.lobes[chosen];
    LobeSample s = sample_lobe(lobe, n_geometric, wo, u_lobe, u);
    if (!(s.pdf_sa > 0.0f)) return out;
    if ((lobe.flags & LOBE_BUMPED) && !s.transmitted)
        s.f *= bump_shadow(lobe, is_diffuse(lobe.type), set.n_smooth, s.direction, false);
    out.direction = s.direction;
    out.roughness = s.roughness;
    out.eta = s.eta;
    out.transmitted = s.transmitted;
    out.lobe_class = lobe_class(lobe, s.direction);
    if (s.delta) {
        out.delta = true;
        out.pdf_sa = 1.0f;
        out.throughput = s.f * lobe.weight * (weight_sum / (s.pdf_sa * lobe.sample_weight));
        return out;
    }
    add_to_class(out.value, out.lobe_class, s.f * lobe.weight);
    float pdf_sum = s.pdf_sa * lobe.sample_weight;
    for (int i = 0; i < lobe_count(set); ++i) {
        if (i == chosen) continue;
        const Lobe& other = set.lobes[i];
        LobeValue v = eval_lobe(other, set.n_smooth, wo, s.direction);
        if (!(v.pdf_sa > 0.0f)) continue;
        add_to_class(out.value, lobe_class(other, s.direction), v.f * other.weight);
        pdf_sum += v.pdf_sa * other.sample_weight;
    }
    out.pdf_sa = pdf_sum / weight_sum;
    out.throughput = total(out.value) / out.pdf_sa;
    return out;
}

// Filter Glossy: no lobe is sharper than `roughness` (alpha) after a blurring bounce.
LUCH_FN void blur_closures(ClosureSet& set, float roughness) {
    for (int i = 0; i < lobe_count(set); ++i) {
        Lobe& lobe = set.lobes[i];
        if (lobe.type < LobeType::MICROFACET_REFLECTION) continue;
        if (!(min_f(lobe.alpha_x, lobe.alpha_y) < roughness)) continue;
        lobe.flags |= LOBE_BLURRED;
        lobe.alpha_x = max_f(lobe.alpha_x, roughness);
        lobe.alpha_y = max_f(lobe.alpha_y, roughness);
        if (plan::FIBRES && lobe.type == LobeType::HAIR_FIBRE) lobe.c1.x = max_f(lobe.c1.x, roughness);
    }
}

// What the lobes reflect and transmit of a white surrounding: the Color passes.
LUCH_FN_SLOW BsdfValue closure_albedo(const ClosureSet& set, Vec3 wo) {
    BsdfValue value = {};
    for (int i = 0; i < lobe_count(set); ++i) {
        const Lobe& lobe = set.lobes[i];
        if (lobe.type < LobeType::MICROFACET_REFLECTION) {
            add_to_class(value, lobe_class(lobe, lobe.normal), lobe.weight);
        } else if (is_hair(lobe.type)) {
            bool fibre = is_fibre(lobe.type);
            add_to_class(value, lobe_class(lobe, lobe.normal),
                         fibre ? lobe.weight * fibre_albedo(lobe, wo) : lobe.weight);
        } else {
            FresnelTerm albedo = lobe_albedo(lobe, wo);
            value.glossy += lobe.weight * albedo.reflected;
            value.transmission += lobe.weight * albedo.transmitted;
        }
    }
    return value;
}

// Whether a direction from elsewhere can find a lobe: mirrors can only be sampled.
LUCH_FN bool has_smooth_lobe(const ClosureSet& set) {
    for (int i = 0; i < lobe_count(set); ++i) {
        const Lobe& lobe = set.lobes[i];
        if (plan::SUBSURFACE && is_subsurface(lobe.type)) continue;  // light is looked for where it comes out
        if (lobe.type == LobeType::ASHIKHMIN_SHIRLEY
                ? !is_phong_mirror(lobe)
                : lobe.type < LobeType::MICROFACET_REFLECTION || is_hair(lobe.type) || !is_mirror(lobe))
            return true;
    }
    return false;
}

// Mean normal of the lobes by weight: the Denoising Normal pass.
LUCH_FN Vec3 shading_normal(const ClosureSet& set, Vec3 fallback) {
    Vec3 sum = make_vec3(0.0f);
    for (int i = 0; i < lobe_count(set); ++i) sum += set.lobes[i].normal * average(set.lobes[i].weight);
    return normalize_or(sum, fallback);
}

}  // namespace luch

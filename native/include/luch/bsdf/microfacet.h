// Rough reflection and refraction on GGX and Beckmann microfacets with height-correlated Smith
// masking, sampled by the visible normals.
//
// Sources: Walter et al. 2007 (the model), Heitz 2014 (masking), Dupuy and Benyoub 2023 (visible
// normals of GGX by spherical caps), Eto and Tokuyoshi 2023 (the caps' bound for reflection).
#pragma once
#include "luch/bsdf/beckmann.h"
#include "luch/bsdf/lobe_fresnel.h"
#include "luch/bsdf/lobe_value.h"
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

LUCH_FN bool is_mirror(const Lobe& l) { return l.alpha_x * l.alpha_y <= MIRROR_ALPHA2; }
LUCH_FN bool is_anisotropic(const Lobe& l) { return plan::ANISOTROPY && l.alpha_x != l.alpha_y; }

struct Frame {
    Vec3 t, b, n;
};
LUCH_FN Frame lobe_frame(const Lobe& l) {
    Frame f;
    f.n = l.normal;
    if (is_anisotropic(l)) {
        f.t = l.tangent;
        f.b = cross(f.n, f.t);
    } else {
        make_frame(f.n, &f.t, &f.b);
    }
    return f;
}
LUCH_FN Vec3 to_local(Vec3 w, const Frame& f) { return {dot(w, f.t), dot(w, f.b), dot(w, f.n)}; }

// A pair of directions and their half vector as the microsurface sees them: cosines to the normal, and
// "stretched" squared sines alpha_x^2 x^2 + alpha_y^2 y^2 (of the half vector x^2 / alpha_x^2 + ...).
struct FacetAngles {
    float cos_o, cos_i, cos_h;
    float sin2_o, sin2_i, sin2_h;
};
LUCH_FN FacetAngles facet_angles(const Lobe& l, Vec3 o, Vec3 i, Vec3 h) {
    float ax2 = sqr(l.alpha_x), ay2 = sqr(l.alpha_y);
    // Refraction has no anisotropy: the mean roughness serves.
    if (i.z < 0.0f) ax2 = ay2 = l.alpha_x * l.alpha_y;
    return {o.z,
            i.z,
            h.z,
            ax2 * sqr(o.x) + ay2 * sqr(o.y),
            ax2 * sqr(i.x) + ay2 * sqr(i.y),
            sqr(h.x) / ax2 + sqr(h.y) / ay2};
}
// The same of an isotropic lobe, which needs no frame.
LUCH_FN FacetAngles facet_angles_isotropic(const Lobe& l, Vec3 h, float cos_o, float cos_i) {
    float a2 = l.alpha_x * l.alpha_y;
    Vec3 across = cross(l.normal, h);  // 1 - cos^2 would lose the sharpest lobes to rounding
    return {cos_o,
            cos_i,
            dot(l.normal, h),
            a2 * (1.0f - sqr(cos_o)),
            a2 * (1.0f - sqr(cos_i)),
            length_squared(across) / a2};
}

// cos_o > 0; cos_i > 0 reflects, < 0 refracts.
struct Facets {
    float density;   // D of the half vector
    float g1, g2;    // masking of wo, and of both, each over cos_o
};

// How far the cap of visible normals can be cut without losing a reflection above the horizon.
LUCH_FN float cap_bound(const Lobe& l, float cos_o) {
    float a2 = sqr(min_f(l.alpha_x, l.alpha_y)), cos2 = sqr(cos_o);
    float s2 = sqr(1.0f + safe_sqrt(1.0f - cos2));
    return (1.0f - a2) * s2 / (s2 + a2 * cos2);
}
LUCH_FN bool is_ggx(const Lobe& l) { return !plan::BECKMANN || l.distribution == Distribution::GGX; }
LUCH_FN bool uses_cap_bound(const Lobe& l) { return l.type == LobeType::MICROFACET_REFLECTION && is_ggx(l); }

LUCH_FN Facets facets(const Lobe& l, const FacetAngles& a) {
    Facets f;
    float a2 = l.alpha_x * l.alpha_y;
    if (is_ggx(l)) {
        f.density = INV_PI / (a2 * sqr(a.sin2_h + sqr(a.cos_h)));
        float t_o = sqrt_f(sqr(a.cos_o) + a.sin2_o), t_i = sqrt_f(sqr(a.cos_i) + a.sin2_i), c_i = abs_f(a.cos_i);
        f.g1 = 2.0f / ((uses_cap_bound(l) ? cap_bound(l, a.cos_o) : 1.0f) * a.cos_o + t_o);
        f.g2 = 2.0f * c_i / max_f(t_o * c_i + t_i * a.cos_o, 1e-30f);
    } else {
        float z2 = max_f(sqr(a.cos_h), 1e-20f), o2 = a.sin2_o / sqr(a.cos_o);
        f.density = exp_f(-a.sin2_h / z2) * INV_PI / (a2 * sqr(z2));
        float lambda_i = beckmann_lambda(a.sin2_i / max_f(sqr(a.cos_i), 1e-30f));
        f.g1 = 1.0f / (a.cos_o * (1.0f + beckmann_lambda_exact(o2)));
        f.g2 = 1.0f / (a.cos_o * (1.0f + beckmann_lambda(o2) + lambda_i));
    }
    return f;
}

LUCH_FN float reflect_probability(const FresnelTerm& f) {
    float r = average(f.reflected), sum = r + average(f.transmitted);
    return sum > 0.0f ? r / sum : 0.0f;
}

LUCH_FN_SLOW LobeValue eval_microfacet(const Lobe& l, Vec3 wo, Vec3 wi) {
    float cos_o = dot(l.normal, wo), cos_i = dot(l.normal, wi);
    bool through = cos_i < 0.0f;
    if (!(cos_o > 0.0f) || is_mirror(l)) return no_value();
    if (through ? !can_transmit(l) || abs_f(l.ior - 1.0f) < STRAIGHT_IOR : !can_reflect(l)) return no_value();
    Vec3 h = through ? -(l.ior * wi + wo) : wi + wo;
    float inv_length = safe_divide(1.0f, length(h));
    h *= inv_length;
    FacetAngles angles;
    if (is_anisotropic(l)) {
        Frame frame = lobe_frame(l);
        angles = facet_angles(l, to_local(wo, frame), to_local(wi, frame), to_local(h, frame));
    } else {
        angles = facet_angles_isotropic(l, h, cos_o, cos_i);
    }
    float cos_ho = dot(h, wo), cos_hi = dot(h, wi);
    // The facet is seen by both from its right side, or no light takes this way. Cycles does not ask. In
    // lobes as they are that is light from nowhere; where Filter Glossy has blurred one, which is an
    // approximation whose look users know, it is 1 % of what lies under glass: there neither do we.
    if (through && !(l.flags & LOBE_BLURRED) && !(cos_ho * angles.cos_h > 0.0f && cos_hi * angles.cos_h < 0.0f))
        return no_value();
    FresnelTerm fresnel = fresnel_term(l, abs_f(cos_ho));
    float reflects = can_transmit(l) ? reflect_probability(fresnel) : 1.0f;
    Facets f = facets(l, angles);
    float common = f.density * (through ? sqr(l.ior * inv_length) * abs_f(cos_ho * cos_hi) : 0.25f);
    Color share = through ? fresnel.transmitted : fresnel.reflected;
    return {share * (common * f.g2 * l.energy_scale), common * f.g1 * (through ? 1.0f - reflects : reflects)};
}

// Visible normal of GGX for local direction o; `bound` cuts the cap, 1 keeps it whole.
LUCH_FN Vec3 sample_visible_ggx(const Lobe& l, Vec3 o, float bound, Vec2 u) {
    Vec3 std_o = normalize(make_vec3(l.alpha_x * o.x, l.alpha_y * o.y, o.z));
    float low = bound * std_o.z;
    float z = (1.0f - u.y) * (1.0f + low) - low;
    float r = safe_sqrt(1.0f - z * z), sine, cosine;
    sincos_turns(u.x, &sine, &cosine);
    Vec3 h = make_vec3(r * cosine, r * sine, z) + std_o;
    return normalize_or(make_vec3(l.alpha_x * h.x, l.alpha_y * h.y, max_f(h.z, 0.0f)), make_vec3(0.0f, 0.0f, 1.0f));
}

LUCH_FN_SLOW LobeSample sample_microfacet(const Lobe& l, Vec3 n_geometric, Vec3 wo, float u_side, Vec2 u) {
    LobeSample s = {};
    Frame frame = lobe_frame(l);
    Vec3 o = to_local(wo, frame);
    if (!(o.z > 0.0f)) return s;
    bool mirror = is_mirror(l);
    Vec3 h = {0.0f, 0.0f, 1.0f};
    if (!mirror) {
        h = is_ggx(l) ? sample_visible_ggx(l, o, uses_cap_bound(l) ? cap_bound(l, o.z) : 1.0f, u)
                      : sample_visible_beckmann(o, l.alpha_x, l.alpha_y, u);
    }
    float cos_ho = dot(h, o);
    FresnelTerm fresnel = fresnel_term(l, cos_ho);
    float reflects = reflect_probability(fresnel);
    if (is_zero(fresnel.reflected) && is_zero(fresnel.transmitted)) return s;
    s.transmitted = !(u_side < reflects);
    float inv_ior = 1.0f / l.ior;
    Vec3 i = s.transmitted ? h * (inv_ior * cos_ho - fresnel.cos_t) - o * inv_ior : h * (2.0f * cos_ho) - o;
    s.direction = to_world(i, frame.t, frame.b, frame.n);
    if ((dot(n_geometric, s.direction) < 0.0f) != s.transmitted || (i.z < 0.0f) != s.transmitted) return s;
    s.f = s.transmitted ? fresnel.transmitted : fresnel.reflected;
    s.pdf_sa = s.transmitted ? 1.0f - reflects : reflects;
    s.delta = mirror || (s.transmitted && abs_f(l.ior - 1.0f) < STRAIGHT_IOR);
    s.roughness = min_f(l.alpha_x, l.alpha_y);
    s.eta = s.transmitted ? l.ior : 1.0f;
    s.f *= l.energy_scale;
    if (s.delta) return s;
    Facets f = facets(l, facet_angles(l, o, i, h));
    float common =
        f.density * (s.transmitted ? abs_f(cos_ho * fresnel.cos_t) / sqr(cos_ho * inv_ior - fresnel.cos_t) : 0.25f);
    s.f *= common * f.g2;
    s.pdf_sa *= common * f.g1;
    return s;
}

}  // namespace luch

// Ashikhmin and Shirley 2000, "An Anisotropic Phong BRDF Model", without its Fresnel factor.
#pragma once
#include "luch/bsdf/lobe_value.h"
#include "luch/bsdf/microfacet.h"
#include "luch/math/bounds.h"

namespace luch {

LUCH_FN bool is_phong_mirror(const Lobe& l) { return max_f(l.alpha_x, l.alpha_y) <= PHONG_MIN_ALPHA; }
LUCH_FN float phong_exponent(float alpha) { return 2.0f / sqr(alpha) - 2.0f; }

LUCH_FN_SLOW LobeValue eval_ashikhmin_shirley(const Lobe& l, Vec3 wo, Vec3 wi) {
    float cos_o = dot(l.normal, wo), cos_i = dot(l.normal, wi);
    if (is_phong_mirror(l) || !(cos_o >= 0.0f && cos_i >= 0.0f)) return no_value();
    cos_o = max_f(cos_o, SMALLEST_COSINE);
    cos_i = max_f(cos_i, SMALLEST_COSINE);
    Vec3 h = normalize_or(wo + wi, l.normal);
    float cos_ho = max_f(abs_f(dot(h, wo)), SMALLEST_COSINE), cos_h = max_f(dot(h, l.normal), SMALLEST_COSINE);
    float n_x = phong_exponent(l.alpha_x), n_y = phong_exponent(l.alpha_y);
    float exponent = n_x;
    if (is_anisotropic(l)) {
        Vec3 b = cross(l.normal, l.tangent);
        float sin2 = 1.0f - sqr(cos_h);
        exponent = sin2 > 0.0f ? (n_x * sqr(dot(h, l.tangent)) + n_y * sqr(dot(h, b))) / sin2 : 0.0f;
    }
    float lobe = cos_h < 1.0f ? pow_f(cos_h, exponent) : 1.0f;
    float common = sqrt_f((n_x + 1.0f) * (n_y + 1.0f)) / (8.0f * PI) * lobe / cos_ho;
    return {make_vec3(common * cos_i / max_f(cos_o, cos_i)), common};
}

LUCH_FN_SLOW LobeSample sample_ashikhmin_shirley(const Lobe& l, Vec3 n_geometric, Vec3 wo, Vec2 u) {
    LobeSample s = {};
    if (!(dot(l.normal, wo) > 0.0f)) return s;
    float n_x = phong_exponent(l.alpha_x), n_y = phong_exponent(l.alpha_y);
    Frame frame = lobe_frame(l);
    // The ellipse of exponents turns a uniform angle; the four quadrants share one formula.
    float sine, cosine;
    sincos_turns(u.x, &sine, &cosine);
    float x = sqrt_f(n_y + 1.0f) * cosine, y = sqrt_f(n_x + 1.0f) * sine;
    float inv = 1.0f / sqrt_f(x * x + y * y);
    x *= inv;
    y *= inv;
    float cos_h = pow_f(u.y, 1.0f / (n_x * x * x + n_y * y * y + 1.0f));
    float sin_h = safe_sqrt(1.0f - sqr(cos_h));
    Vec3 h = to_world(make_vec3(x * sin_h, y * sin_h, cos_h), frame.t, frame.b, frame.n);
    s.direction = h * (2.0f * dot(h, wo)) - wo;
    s.roughness = min_f(l.alpha_x, l.alpha_y);
    if (dot(n_geometric, s.direction) < 0.0f || !(dot(h, wo) > 0.0f)) return s;
    if (is_phong_mirror(l)) {
        s.delta = true;
        s.f = make_vec3(1.0f);
        s.pdf_sa = 1.0f;
        return s;
    }
    LobeValue v = eval_ashikhmin_shirley(l, wo, s.direction);
    s.f = v.f;
    s.pdf_sa = v.pdf_sa;
    return s;
}

}  // namespace luch

// Lambert, Oren-Nayar and translucent lobes.
#pragma once
#include "luch/bsdf/lobe_value.h"
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

// Fujii's Oren-Nayar: the directional albedo is PI A + B G(cos). Source: Fujii, "A tiny improvement
// of Oren-Nayar reflectance model"; the compensation of lost energy is OpenPBR's.
LUCH_FN float oren_nayar_g(float cos_theta) {
    // The exact form divides by the cosine; its limit at the horizon is linear.
    if (cos_theta < SMALLEST_COSINE) return (HALF_PI - 2.0f / 3.0f) - cos_theta;
    float sin_theta = safe_sqrt(1.0f - sqr(cos_theta));
    float theta = acos_f(cos_theta);
    return sin_theta * (theta - 2.0f / 3.0f - sin_theta * cos_theta) +
           2.0f / 3.0f * (sin_theta / cos_theta) * (1.0f - sin_theta * sin_theta * sin_theta);
}

// alpha_x, alpha_y: the model's A and B; c0: the light of many bounces, less the factor of wi.
LUCH_FN void prepare_oren_nayar(Lobe& lobe, Color color, float cos_wo, float roughness) {
    float sigma = saturate_f(roughness);
    float a = 1.0f / (PI + sigma * (HALF_PI - 2.0f / 3.0f)), b = sigma * a;
    Color albedo = min_v(max_v(color, make_vec3(0.0f)), make_vec3(1.0f));
    float mean_albedo = a * PI + ((TWO_PI - 5.6f) / 3.0f) * b;
    float lost = 1.0f - mean_albedo;
    Color many = (INV_PI * mean_albedo / lost) * albedo * albedo / (make_vec3(1.0f) - albedo * lost);
    lobe.type = LobeType::OREN_NAYAR;
    lobe.alpha_x = a;
    lobe.alpha_y = b;
    lobe.extra = roughness;
    lobe.c0 = many * (1.0f - (a * PI + b * oren_nayar_g(max_f(cos_wo, 0.0f))));
}

LUCH_FN Color oren_nayar_f(const Lobe& lobe, Vec3 wo, Vec3 wi, float cos_wi) {
    float cos_wo = max_f(dot(lobe.normal, wo), 0.0f);
    float t = dot(wi, wo) - cos_wi * cos_wo;
    if (t > 0.0f) t /= max_f(max_f(cos_wi, cos_wo), 1e-30f);
    float once = lobe.alpha_x + lobe.alpha_y * t;
    float lost = 1.0f - (lobe.alpha_x * PI + lobe.alpha_y * oren_nayar_g(cos_wi));
    return cos_wi * (make_vec3(once) + lobe.c0 * lost);
}

LUCH_FN LobeValue eval_diffuse(const Lobe& lobe, Vec3 wi) {
    float pdf = max_f(dot(lobe.normal, wi), 0.0f) * INV_PI;
    return {make_vec3(pdf), pdf};
}
LUCH_FN LobeValue eval_oren_nayar(const Lobe& lobe, Vec3 wo, Vec3 wi) {
    float cos_wi = dot(lobe.normal, wi);
    if (!(cos_wi > 0.0f)) return no_value();
    return {oren_nayar_f(lobe, wo, wi, cos_wi), cos_wi * INV_PI};
}
LUCH_FN LobeValue eval_translucent(const Lobe& lobe, Vec3 wi) {
    float pdf = max_f(-dot(lobe.normal, wi), 0.0f) * INV_PI;
    return {make_vec3(pdf), pdf};
}

LUCH_FN Vec3 sample_cosine_around(Vec3 n, Vec2 u) {
    Vec3 t, b;
    make_frame(n, &t, &b);
    return to_world(sample_cosine_hemisphere(u), t, b, n);
}

}  // namespace luch

// Two models of fibres standing on a surface: microfibres, a linearly transformed cosine (Zeltner,
// Burley, Chiang 2022), and Ashikhmin's velvet of inverted Gaussian facets.
#pragma once
#include "luch/bsdf/albedo.h"
#include "luch/bsdf/lobe_value.h"
#include "luch/bsdf/sheen_table.h"
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

// Makes lobe.alpha_x, alpha_y the transform's A and B and tangent the viewer's direction in the
// surface, and scales the weight by the albedo. False: these fibres reflect nothing here.
LUCH_FN bool prepare_sheen(Lobe& lobe, Vec3 wo, float roughness) {
    Vec3 b = cross(lobe.normal, wo), t;
    if (length_squared(b) > SHEEN_HEAD_ON_SINE2) {
        t = cross(normalize(b), lobe.normal);
    } else {
        make_frame(lobe.normal, &t, &b);
    }
    lobe.tangent = t;
    TableSpot x = table_spot(dot(lobe.normal, wo), SHEEN_TABLE_SIZE);
    TableSpot y = table_spot(clamp_f(roughness, SHEEN_MIN_ROUGHNESS, 1.0f), SHEEN_TABLE_SIZE);
    lobe.alpha_x = table_2d(SHEEN_A, x, y, SHEEN_TABLE_SIZE);
    lobe.alpha_y = table_2d(SHEEN_B, x, y, SHEEN_TABLE_SIZE);
    float albedo = table_2d(SHEEN_ALBEDO, x, y, SHEEN_TABLE_SIZE);
    if (!(abs_f(lobe.alpha_x) >= SHEEN_LEAST) || !(albedo >= SHEEN_LEAST)) return false;
    lobe.weight *= albedo;
    lobe.sample_weight *= albedo;
    return true;
}

LUCH_FN LobeValue eval_sheen(const Lobe& lobe, Vec3 wi) {
    Vec3 b = cross(lobe.normal, lobe.tangent);
    float x = dot(wi, lobe.tangent), y = dot(wi, b), z = dot(wi, lobe.normal);
    if (!(z > 0.0f)) return no_value();
    float A = lobe.alpha_x, B = lobe.alpha_y;
    float length2 = sqr(A * x + B * z) + sqr(A * y) + sqr(z);
    float pdf = INV_PI * z * sqr(A / length2);
    return {make_vec3(pdf), pdf};
}
LUCH_FN Vec3 sample_sheen(const Lobe& lobe, Vec2 u) {
    Vec3 c = sample_cosine_hemisphere(u);
    Vec3 local = normalize(make_vec3(c.x - c.z * lobe.alpha_y, c.y, c.z * lobe.alpha_x));
    return to_world(local, lobe.tangent, cross(lobe.normal, lobe.tangent), lobe.normal);
}

// lobe.extra: 1 / sigma^2.
LUCH_FN LobeValue eval_velvet(const Lobe& lobe, Vec3 wo, Vec3 wi) {
    float cos_o = dot(lobe.normal, wo), cos_i = dot(lobe.normal, wi);
    if (!(cos_o > 0.0f && cos_i > 0.0f)) return no_value();
    Vec3 h = normalize_or(wo + wi, lobe.normal);
    float cos_h = dot(lobe.normal, h), cos_ho = abs_f(dot(wo, h));
    const float pdf = 0.5f * INV_PI;
    if (!(abs_f(cos_h) < 1.0f - VELVET_LEAST && cos_ho > VELVET_LEAST)) return no_value();  // no fibre lies there
    float ratio = 2.0f * max_f(cos_h / cos_ho, VELVET_LEAST);
    float sin2 = 1.0f - sqr(cos_h);
    float density = exp_f(-sqr(cos_h) / sin2 * lobe.extra) * lobe.extra * INV_PI / sqr(sin2);
    float masking = min_f(1.0f, ratio * min_f(cos_o, cos_i));
    return {make_vec3(0.25f * density * masking / cos_o), pdf};
}
LUCH_FN Vec3 sample_uniform_around(Vec3 n, Vec2 u) {
    Vec3 t, b;
    make_frame(n, &t, &b);
    return to_world(sample_uniform_hemisphere(u), t, b, n);
}

}  // namespace luch

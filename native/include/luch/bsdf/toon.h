// Light in a cone with a soft rim: around the normal (diffuse) or the mirrored view (glossy).
#pragma once
#include "luch/bsdf/lobe_value.h"
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

// alpha_x: half angle of full brightness; alpha_y: width of the rim; extra: 1 - cos of both together.
LUCH_FN void prepare_toon(Lobe& lobe, float size, float smooth) {
    lobe.alpha_x = clamp_f(size, TOON_LEAST_SIZE, 1.0f) * HALF_PI;
    lobe.alpha_y = saturate_f(smooth) * HALF_PI;
    float half = 0.5f * min_f(lobe.alpha_x + lobe.alpha_y, HALF_PI);
    lobe.extra = 2.0f * sqr(sin_f(half));  // 1 - cos, which would round to 0 for thin cones
}

LUCH_FN Vec3 toon_axis(const Lobe& lobe, Vec3 wo) {
    return lobe.type == LobeType::TOON_DIFFUSE ? lobe.normal : reflect(wo, lobe.normal);
}

LUCH_FN LobeValue toon_value(const Lobe& lobe, float one_minus_cos) {
    if (!(one_minus_cos < lobe.extra)) return no_value();
    float angle = 2.0f * asin_f(safe_sqrt(0.5f * one_minus_cos));
    float rim = angle - lobe.alpha_x;
    float bright = !(rim > 0.0f) ? 1.0f : saturate_f(1.0f - rim / lobe.alpha_y);
    float pdf = 0.5f * INV_PI / lobe.extra;
    return {make_vec3(pdf * bright), pdf};
}

LUCH_FN LobeValue eval_toon(const Lobe& lobe, Vec3 wo, Vec3 wi) {
    bool glossy = lobe.type == LobeType::TOON_GLOSSY;
    if (!(dot(lobe.normal, wi) > 0.0f) || (glossy && !(dot(lobe.normal, wo) > 0.0f))) return no_value();
    return toon_value(lobe, 0.5f * length_squared(toon_axis(lobe, wo) - wi));  // 1 - cos, exact for thin cones
}

LUCH_FN Vec3 sample_toon(const Lobe& lobe, Vec3 wo, Vec2 u) {
    Vec3 axis = toon_axis(lobe, wo), t, b;
    make_frame(axis, &t, &b);
    return to_world(sample_cone(lobe.extra, u), t, b, axis);
}

}  // namespace luch

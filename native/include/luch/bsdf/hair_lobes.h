// The Hair BSDF node: one reflection, or one transmission, of a fibre. A Cauchy distribution along the fibre around the
// mirror's cone, tilted by an offset; around it a cosine (reflection) or another Cauchy distribution (transmission).
// Source: Marschner et al. 2003, "Light Scattering from Human Hair Fibers", in the separable form of Hery, Ramamoorthi
// 2012, "Importance Sampling of Reflection from Hair Fibers".
#pragma once
#include "luch/bsdf/lobe_value.h"
#include "luch/math/bounds.h"
#include "luch/math/fn.h"
#include "luch/sampling/warp.h"

namespace luch {

// Where a lobe keeps it: tangent: along the fibre; alpha_x, alpha_y: widths along and around it; extra: the offset, radians.
struct HairFrame {
    Vec3 x, y;  // across the fibre: y towards the viewer
    float theta_o;  // from the plane across the fibre
    float first, range;  // of the Cauchy distribution along the fibre, as angles of its inverse
};

LUCH_FN HairFrame make_hair_frame(const Lobe& l, Vec3 wo) {
    HairFrame frame;
    Vec3 t, b;
    make_frame(l.tangent, &t, &b);
    float along = clamp_f(dot(l.tangent, wo), -1.0f, 1.0f);
    frame.y = normalize_or(wo - l.tangent * along, t);
    frame.x = cross(frame.y, l.tangent);
    frame.theta_o = asin_f(along);
    frame.first = atan_f((0.5f * (frame.theta_o - HALF_PI) - l.extra) / l.alpha_x);
    frame.range = atan_f((0.5f * (frame.theta_o + HALF_PI) - l.extra) / l.alpha_x) - frame.first;
    return frame;
}

LUCH_FN LobeValue hair_value(const Lobe& l, const HairFrame& frame, float theta_i, float phi) {
    if (HALF_PI - abs_f(theta_i) < GRAZING_FIBRE) return no_value();
    float from_cone = 0.5f * (theta_i + frame.theta_o) - l.extra;
    float along = l.alpha_x /
                  (2.0f * (sqr(from_cone) + sqr(l.alpha_x)) * frame.range * max_f(cos_f(theta_i), SMALLEST_COSINE)),
          around, around_pdf;
    if (l.type == LobeType::HAIR_REFLECTION) {
        if (abs_f(phi) > HALF_PI) return no_value();
        around = around_pdf = cos_f(min_f(abs_f(phi) / l.alpha_y, PI) * 0.5f) * 0.25f / l.alpha_y;
    } else {
        float rest = PI - abs_f(phi);
        // Of weight 1 over the half turn away from the viewer, as in Cycles; what lies beyond is there too, and sampled.
        float shape = l.alpha_y / (2.0f * (sqr(rest) + sqr(l.alpha_y)));
        around = shape / atan_f(HALF_PI / l.alpha_y);
        around_pdf = shape / atan_f(PI / l.alpha_y);
    }
    return {make_vec3(max_f(along * around, 0.0f)), max_f(along * around_pdf, 0.0f)};
}

LUCH_FN bool is_hair_side(const Lobe& l, Vec3 wi) {
    return (dot(l.normal, wi) < 0.0f) == (l.type == LobeType::HAIR_TRANSMISSION);
}

LUCH_FN_SLOW LobeValue eval_hair(const Lobe& l, Vec3 wo, Vec3 wi) {
    if (!is_hair_side(l, wi)) return no_value();
    HairFrame frame = make_hair_frame(l, wo);
    float phi = atan2_f(dot(wi, frame.x), dot(wi, frame.y));
    return hair_value(l, frame, asin_f(clamp_f(dot(l.tangent, wi), -1.0f, 1.0f)), phi);
}

LUCH_FN_SLOW LobeSample sample_hair(const Lobe& l, Vec3 wo, Vec2 u) {
    HairFrame frame = make_hair_frame(l, wo);
    float theta_i = 2.0f * (l.alpha_x * tan_f(u.x * frame.range + frame.first) + l.extra) - frame.theta_o, phi;
    if (l.type == LobeType::HAIR_REFLECTION)
        phi = 2.0f * asin_f(1.0f - 2.0f * u.y) * l.alpha_y;
    else
        phi = PI + l.alpha_y * tan_f(2.0f * atan_f(PI / l.alpha_y) * (u.y - 0.5f));
    float sin_theta, cos_theta, sin_phi, cos_phi;
    sincos_f(theta_i, &sin_theta, &cos_theta);
    sincos_f(phi, &sin_phi, &cos_phi);
    LobeSample s = {};
    s.direction = frame.y * (cos_phi * cos_theta) + frame.x * (sin_phi * cos_theta) + l.tangent * sin_theta;
    s.roughness = min_f(l.alpha_x, l.alpha_y);
    s.eta = 1.0f;
    s.transmitted = l.type == LobeType::HAIR_TRANSMISSION;
    if (!is_hair_side(l, s.direction)) return s;
    LobeValue value = hair_value(l, frame, theta_i, phi > PI ? phi - TWO_PI : phi);
    s.f = value.f;
    s.pdf_sa = value.pdf_sa;
    return s;
}

}  // namespace luch

// Principled Hair: a rough dielectric cylinder, near field. Source: Chiang, Bitterli, Tappan, Burley 2016, "A Practical and
// Controllable Hair and Fur Model for Production Path Tracing"; the products of lobes along and around the fibre are those
// of d'Eon et al. 2011 and Marschner et al. 2003. Written anew, with the Bessel function by its scaled polynomials
// (Abramowitz, Stegun 1964, 9.8.1 and 9.8.2), so that a fibre that absorbs nothing loses nothing.
#pragma once
#include "luch/bsdf/fresnel.h"
#include "luch/bsdf/lobe_value.h"
#include "luch/math/bounds.h"

namespace luch {

// Where a lobe keeps it: normal: of the fibre's surface; tangent: along it; ior; c0: absorption, by radius; alpha_x: variance
// along the fibre; alpha_y: scale around it; c1: variance along of the first reflection, tilt of the scales in radians, h.
// h: the sine of the angle between the fibre's normal and the ray, seen along the fibre.
LUCH_FN float fibre_coat(const Lobe& l) { return l.c1.x; }
LUCH_FN float fibre_tilt(const Lobe& l) { return l.c1.y; }
LUCH_FN float fibre_offset(const Lobe& l) { return l.c1.z; }

inline constexpr int FIBRE_LOBES = 4;  // R, TT, TRT, and all that is reflected inside more often

LUCH_FN float cosine_of_sine(float sine) { return safe_sqrt(1.0f - sine * sine); }

// e^-x I0(x), x >= 0.
LUCH_FN float scaled_bessel_i0(float x) {
    if (x < 3.75f) {
        float t = sqr(x * (1.0f / 3.75f));
        float sum =
            1.0f + t * (3.5156229f +
                        t * (3.0899424f + t * (1.2067492f + t * (0.2659732f + t * (0.0360768f + t * 0.0045813f)))));
        return exp_f(-x) * sum;
    }
    float t = 3.75f / x;
    float sum = 0.39894228f +
                t * (0.01328592f +
                     t * (0.00225319f +
                          t * (-0.00157565f +
                               t * (0.00916281f +
                                    t * (-0.02057706f + t * (0.02635537f + t * (-0.01647633f + t * 0.00392377f)))))));
    return sum / sqrt_f(x);
}

// Density of the sine of the angle along the fibre, for a variance v; it sums to 1 over sin_i.
LUCH_FN float along_fibre(float sin_i, float cos_i, float sin_o, float cos_o, float v) {
    float inverse = 1.0f / v, a = cos_i * cos_o * inverse, b = sin_i * sin_o * inverse;
    return scaled_bessel_i0(a) * exp_f(a - b - inverse) * inverse / (1.0f - exp_f(-2.0f * inverse));
}

LUCH_FN float logistic_below(float x, float s) {
    float arg = -x / s;
    return arg > 88.0f ? 0.0f : 1.0f / (1.0f + exp_f(arg));
}
// Density of an angle from -pi to pi around the fibre.
LUCH_FN float around_fibre(float angle, float s) {
    float e = exp_f(-abs_f(angle) / s);
    return e / (s * sqr(1.0f + e)) / (1.0f - 2.0f * logistic_below(-PI, s));
}
LUCH_FN float sample_around_fibre(float u, float s) {
    float below = logistic_below(-PI, s), share = u * (1.0f - 2.0f * below) + below;
    return clamp_f(-s * log_f(1.0f / share - 1.0f), -PI, PI);
}
LUCH_FN float wrapped_angle(float a) { return a - TWO_PI * floor_f((a + PI) * (1.0f / TWO_PI)); }

// All that follows from the fibre and the direction to the viewer.
struct Fibre {
    Vec3 x, y, z;  // x along it, the viewer in the plane of x and z's side
    float sin_o, cos_o, phi_o;
    Color attenuation[FIBRE_LOBES];
    float share[FIBRE_LOBES];  // of all lobes' light, to choose by
    float tilted_sin[FIBRE_LOBES], tilted_cos[FIBRE_LOBES];
    float variance[FIBRE_LOBES];
    float turn[3];  // around the fibre, of the three lobes that keep a direction
};

LUCH_FN void fibre_attenuation(const Lobe& l, float sin_o, float cos_o, Fibre* fibre) {
    float h = fibre_offset(l), cos_gamma_o = cosine_of_sine(h), gamma_o = asin_f(h);
    float sin_gamma_t = clamp_f(h * cos_o / sqrt_f(max_f(sqr(l.ior) - sqr(sin_o), SMALLEST_FIBRE_ROOT)), -1.0f, 1.0f);
    float gamma_t = asin_f(sin_gamma_t), cos_t = cosine_of_sine(min_f(abs_f(sin_o) / l.ior, 1.0f));
    float path = 2.0f * cosine_of_sine(sin_gamma_t) / max_f(cos_t, SMALLEST_COSINE);
    Color through = {exp_f(-l.c0.x * path), exp_f(-l.c0.y * path), exp_f(-l.c0.z * path)};
    float ignored, f = fresnel_dielectric(cos_o * cos_gamma_o, l.ior, &ignored);
    const Color one = make_vec3(1.0f);
    fibre->attenuation[0] = make_vec3(f);
    fibre->attenuation[1] = through * sqr(1.0f - f);
    fibre->attenuation[2] = fibre->attenuation[1] * through * f;
    Color left = one - through * f;
    Color again = {safe_divide(through.x * f, left.x), safe_divide(through.y * f, left.y),
                   safe_divide(through.z * f, left.z)};
    fibre->attenuation[3] = fibre->attenuation[2] * again;
    float sum = 0.0f;
    for (int p = 0; p < FIBRE_LOBES; ++p) sum += fibre->share[p] = luminance(fibre->attenuation[p]);
    for (int p = 0; p < FIBRE_LOBES; ++p) fibre->share[p] = safe_divide(fibre->share[p], sum);
    for (int p = 0; p < 3; ++p) fibre->turn[p] = 2.0f * float(p) * gamma_t - 2.0f * gamma_o + float(p) * PI;
}

LUCH_FN Fibre make_fibre(const Lobe& l, Vec3 wo) {
    Fibre fibre;
    Vec3 t, b;
    make_frame(l.tangent, &t, &b);
    fibre.x = l.tangent;
    fibre.y = normalize_or(cross(fibre.x, wo), t);
    fibre.z = cross(fibre.x, fibre.y);
    fibre.sin_o = clamp_f(dot(wo, fibre.x), -1.0f, 1.0f);
    fibre.cos_o = cosine_of_sine(fibre.sin_o);
    fibre.phi_o = atan2_f(dot(wo, fibre.z), dot(wo, fibre.y));
    fibre_attenuation(l, fibre.sin_o, fibre.cos_o, &fibre);
    // Scales tilt R by 2 alpha, TT by -alpha, TRT by -4 alpha.
    const float turns[3] = {-2.0f, 1.0f, 4.0f};
    for (int p = 0; p < 3; ++p) {
        float sine, cosine;
        sincos_f(turns[p] * fibre_tilt(l), &sine, &cosine);
        fibre.tilted_sin[p] = fibre.sin_o * cosine + fibre.cos_o * sine;
        fibre.tilted_cos[p] = abs_f(fibre.cos_o * cosine - fibre.sin_o * sine);
    }
    fibre.tilted_sin[3] = fibre.sin_o;
    fibre.tilted_cos[3] = fibre.cos_o;
    fibre.variance[0] = fibre_coat(l);
    fibre.variance[1] = 0.25f * l.alpha_x;
    fibre.variance[2] = fibre.variance[3] = 4.0f * l.alpha_x;
    return fibre;
}

LUCH_FN LobeValue fibre_value(const Lobe& l, const Fibre& fibre, float sin_i, float phi) {
    float cos_i = cosine_of_sine(sin_i);
    LobeValue value = no_value();
    for (int p = 0; p < FIBRE_LOBES; ++p) {
        float m = along_fibre(sin_i, cos_i, fibre.tilted_sin[p], fibre.tilted_cos[p], fibre.variance[p]);
        float n = p < 3 ? around_fibre(wrapped_angle(phi - fibre.turn[p]), l.alpha_y) : 1.0f / TWO_PI;
        value.f += fibre.attenuation[p] * (m * n);
        value.pdf_sa += fibre.share[p] * (m * n);
    }
    return value;
}

LUCH_FN_SLOW LobeValue eval_fibre(const Lobe& l, Vec3 wo, Vec3 wi) {
    Fibre fibre = make_fibre(l, wo);
    float phi_i = atan2_f(dot(wi, fibre.z), dot(wi, fibre.y));
    return fibre_value(l, fibre, clamp_f(dot(wi, fibre.x), -1.0f, 1.0f), phi_i - fibre.phi_o);
}

// u_lobe chooses the lobe, and what is left of it the angle along the fibre.
LUCH_FN_SLOW LobeSample sample_fibre(const Lobe& l, Vec3 wo, float u_lobe, Vec2 u) {
    Fibre fibre = make_fibre(l, wo);
    int p = 0;
    for (; p < FIBRE_LOBES - 1 && !(u_lobe < fibre.share[p]); ++p) u_lobe -= fibre.share[p];
    float left = clamp_f(safe_divide(u_lobe, fibre.share[p]), LEAST_FIBRE_NUMBER, 1.0f), v = fibre.variance[p];
    float along = clamp_f(1.0f + v * log_f(left + (1.0f - left) * exp_f(-2.0f / v)), -1.0f, 1.0f);
    float sin_i = -along * fibre.tilted_sin[p] + cosine_of_sine(along) * cos_f(TWO_PI * u.y) * fibre.tilted_cos[p];
    sin_i = clamp_f(sin_i, -1.0f, 1.0f);
    float phi = p < 3 ? fibre.turn[p] + sample_around_fibre(u.x, l.alpha_y) : TWO_PI * u.x;
    float sine, cosine, cos_i = cosine_of_sine(sin_i);
    sincos_f(fibre.phi_o + phi, &sine, &cosine);
    LobeValue value = fibre_value(l, fibre, sin_i, phi);
    LobeSample s = {};
    s.direction = normalize(fibre.x * sin_i + fibre.y * (cos_i * cosine) + fibre.z * (cos_i * sine));
    s.f = value.f;
    s.pdf_sa = value.pdf_sa;
    s.roughness = fibre_coat(l);
    s.eta = 1.0f;
    s.transmitted = p > 0;
    return s;
}

// A fit of how bright a mass of such fibres is, beside roughness around the fibre (the paper's equation 9).
LUCH_FN float fibre_albedo_scale(float x) {
    return ((((0.245f * x + 5.574f) * x - 10.73f) * x + 2.532f) * x - 0.215f) * x + 5.969f;
}
LUCH_FN Color fibre_albedo(const Lobe& l, Vec3 wo) {
    float cos_o = cosine_of_sine(clamp_f(dot(wo, l.tangent), -1.0f, 1.0f)), scale = fibre_albedo_scale(l.alpha_x),
          ignored;
    float f = fresnel_dielectric(cos_o * cosine_of_sine(fibre_offset(l)), l.ior, &ignored);
    return make_vec3(exp_f(-safe_sqrt(l.c0.x) * scale), exp_f(-safe_sqrt(l.c0.y) * scale),
                     exp_f(-safe_sqrt(l.c0.z) * scale)) +
           make_vec3(f);
}

}  // namespace luch

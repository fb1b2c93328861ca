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

// What follows from the fibre and the direction to the viewer for all lobes. What one lobe alone has is asked for as it is
// needed, by functions of its number p: kept for all four, it would fill the registers of a GPU.
struct Fibre {
    Vec3 x, y;  // x along it, the viewer in the plane of x and z's side; z is their product
    float sin_o, cos_o, phi_o;
    float gamma_o, gamma_t;  // across the fibre: angles of the ray with the normal, outside and inside
    float reflected;  // at its surface
    Color through, again;  // what is left on the way across; of TRT, in all that follows
    float sum;  // of all lobes' light
};

LUCH_FN Vec3 fibre_z(const Fibre& fibre) { return cross(fibre.x, fibre.y); }

// before: of lobe p - 1.
LUCH_FN Color fibre_attenuation(const Fibre& fibre, int p, Color before) {
    if (p == 0) return make_vec3(fibre.reflected);
    if (p == 1) return fibre.through * sqr(1.0f - fibre.reflected);
    return p == 2 ? before * fibre.through * fibre.reflected : before * fibre.again;
}
// Of all lobes' light, to choose by.
LUCH_FN float fibre_share(const Fibre& fibre, Color attenuation) {
    return safe_divide(luminance(attenuation), fibre.sum);
}

LUCH_FN void pass_fibre(const Lobe& l, Fibre* fibre) {
    float h = fibre_offset(l), cos_gamma_o = cosine_of_sine(h), sin_o = fibre->sin_o, cos_o = fibre->cos_o;
    float sin_gamma_t = clamp_f(h * cos_o / sqrt_f(max_f(sqr(l.ior) - sqr(sin_o), SMALLEST_FIBRE_ROOT)), -1.0f, 1.0f);
    float cos_t = cosine_of_sine(min_f(abs_f(sin_o) / l.ior, 1.0f));
    fibre->gamma_o = asin_f(h);
    fibre->gamma_t = asin_f(sin_gamma_t);
    float path = 2.0f * cosine_of_sine(sin_gamma_t) / max_f(cos_t, SMALLEST_COSINE);
    Color through = {exp_f(-l.c0.x * path), exp_f(-l.c0.y * path), exp_f(-l.c0.z * path)};
    float ignored, f = fresnel_dielectric(cos_o * cos_gamma_o, l.ior, &ignored);
    Color left = make_vec3(1.0f) - through * f;
    fibre->reflected = f;
    fibre->through = through;
    fibre->again = {safe_divide(through.x * f, left.x), safe_divide(through.y * f, left.y),
                    safe_divide(through.z * f, left.z)};
    fibre->sum = 0.0f;
    Color light = {};
    for (int p = 0; p < FIBRE_LOBES; ++p) {
        light = fibre_attenuation(*fibre, p, light);
        fibre->sum += luminance(light);
    }
}

LUCH_FN Fibre make_fibre(const Lobe& l, Vec3 wo) {
    Fibre fibre;
    Vec3 t, b;
    make_frame(l.tangent, &t, &b);
    fibre.x = l.tangent;
    fibre.y = normalize_or(cross(fibre.x, wo), t);
    fibre.sin_o = clamp_f(dot(wo, fibre.x), -1.0f, 1.0f);
    fibre.cos_o = cosine_of_sine(fibre.sin_o);
    fibre.phi_o = atan2_f(dot(wo, fibre_z(fibre)), dot(wo, fibre.y));
    pass_fibre(l, &fibre);
    return fibre;
}

LUCH_FN float fibre_variance(const Lobe& l, int p) {
    return p == 0 ? fibre_coat(l) : (p == 1 ? 0.25f : 4.0f) * l.alpha_x;
}
// Around the fibre, of the three lobes that keep a direction.
LUCH_FN float fibre_turn(const Fibre& fibre, int p) {
    return 2.0f * float(p) * fibre.gamma_t - 2.0f * fibre.gamma_o + float(p) * PI;
}
// Sine and cosine along the fibre of the direction that a lobe is around.
LUCH_FN Vec2 fibre_cone(const Lobe& l, const Fibre& fibre, int p) {
    if (p == 3) return {fibre.sin_o, fibre.cos_o};
    // Scales tilt R by 2 alpha, TT by -alpha, TRT by -4 alpha.
    float sine, cosine, turns = p == 0 ? -2.0f : (p == 1 ? 1.0f : 4.0f);
    sincos_f(turns * fibre_tilt(l), &sine, &cosine);
    return {fibre.sin_o * cosine + fibre.cos_o * sine, abs_f(fibre.cos_o * cosine - fibre.sin_o * sine)};
}

// A direction as the fibre counts it: sine of its angle along, angle around from the viewer's.
struct FibreDirection {
    float sin_i, phi;
    bool transmitted;
};

LUCH_FN LobeValue fibre_value(const Lobe& l, const Fibre& fibre, const FibreDirection& to) {
    float cos_i = cosine_of_sine(to.sin_i);
    LobeValue value = no_value();
    Color light = {};
    LUCH_KEEP_LOOP
    for (int p = 0; p < FIBRE_LOBES; ++p) {
        Vec2 cone = fibre_cone(l, fibre, p);
        float m = along_fibre(to.sin_i, cos_i, cone.x, cone.y, fibre_variance(l, p));
        float n = p < 3 ? around_fibre(wrapped_angle(to.phi - fibre_turn(fibre, p)), l.alpha_y) : 1.0f / TWO_PI;
        light = fibre_attenuation(fibre, p, light);
        value.f += light * (m * n);
        value.pdf_sa += fibre_share(fibre, light) * (m * n);
    }
    return value;
}

// u.z chooses the lobe, and what is left of it the angle along the fibre.
LUCH_FN FibreDirection choose_fibre_direction(const Lobe& l, const Fibre& fibre, Vec3 u) {
    int p = 0;
    Color light = fibre_attenuation(fibre, 0, {});
    float share = fibre_share(fibre, light);
    LUCH_KEEP_LOOP
    while (p < FIBRE_LOBES - 1 && !(u.z < share)) {
        u.z -= share;
        light = fibre_attenuation(fibre, ++p, light);
        share = fibre_share(fibre, light);
    }
    float left = clamp_f(safe_divide(u.z, share), LEAST_FIBRE_NUMBER, 1.0f), v = fibre_variance(l, p);
    float along = clamp_f(1.0f + v * log_f(left + (1.0f - left) * exp_f(-2.0f / v)), -1.0f, 1.0f);
    Vec2 cone = fibre_cone(l, fibre, p);
    float sin_i = -along * cone.x + cosine_of_sine(along) * cos_f(TWO_PI * u.y) * cone.y;
    float phi = p < 3 ? fibre_turn(fibre, p) + sample_around_fibre(u.x, l.alpha_y) : TWO_PI * u.x;
    return {clamp_f(sin_i, -1.0f, 1.0f), phi, p > 0};
}

// Light along a direction, given or chosen: one function, as most of the way is the same and long to compile.
// asked: the direction, or three numbers to choose one by.
LUCH_FN_SLOW LobeSample meet_fibre(const Lobe& l, Vec3 wo, bool choose, Vec3 asked) {
    Fibre fibre = make_fibre(l, wo);
    FibreDirection to;
    LobeSample s = {};
    if (choose) {
        to = choose_fibre_direction(l, fibre, asked);
        float sine, cosine, cos_i = cosine_of_sine(to.sin_i);
        sincos_f(fibre.phi_o + to.phi, &sine, &cosine);
        s.direction = normalize(fibre.x * to.sin_i + fibre.y * (cos_i * cosine) + fibre_z(fibre) * (cos_i * sine));
        s.transmitted = to.transmitted;
    } else {
        float phi_i = atan2_f(dot(asked, fibre_z(fibre)), dot(asked, fibre.y));
        to = {clamp_f(dot(asked, fibre.x), -1.0f, 1.0f), phi_i - fibre.phi_o, false};
    }
    LobeValue value = fibre_value(l, fibre, to);
    s.f = value.f;
    s.pdf_sa = value.pdf_sa;
    return s;
}

LUCH_FN LobeValue eval_fibre(const Lobe& l, Vec3 wo, Vec3 wi) {
    LobeSample s = meet_fibre(l, wo, false, wi);
    return {s.f, s.pdf_sa};
}
LUCH_FN LobeSample sample_fibre(const Lobe& l, Vec3 wo, float u_lobe, Vec2 u) {
    LobeSample s = meet_fibre(l, wo, true, {u.x, u.y, u_lobe});
    s.roughness = fibre_coat(l);
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

// Fresnel reflectance: dielectrics, conductors, and the models artists steer (F82, remapped F0).
// Cosines are of the angle to the microfacet normal, eta is the index behind it over the one before.
#pragma once
#include "luch/math/bounds.h"
#include "luch/math/fn.h"

namespace luch {

// Reflectances of light polarised across (s) and along (p) the plane of incidence.
struct Polarized {
    float s, p;
};

// Amplitudes whose squares are the reflectances; `cos_t` is the refracted ray's cosine, positive.
// False: total reflection.
LUCH_FN bool dielectric_amplitudes(float cos_i, float eta, Polarized* amplitude, float* cos_t) {
    float t2 = (eta - 1.0f) * (eta + 1.0f) + cos_i * cos_i;  // exact near eta = 1, unlike eta^2 - sin^2
    if (!(t2 > 0.0f)) return false;
    float c = abs_f(cos_i), t = sqrt_f(t2);  // t: eta times cos_t
    *cos_t = t / eta;
    amplitude->s = (c - t) / (c + t);
    amplitude->p = (eta * c - *cos_t) / (eta * c + *cos_t);
    return true;
}

// Unpolarised reflectance. cos_t keeps its value on total reflection.
LUCH_FN float fresnel_dielectric(float cos_i, float eta, float* cos_t) {
    float t2 = (eta - 1.0f) * (eta + 1.0f) + cos_i * cos_i;  // as in dielectric_amplitudes
    if (!(t2 > 0.0f)) return 1.0f;
    float c = abs_f(cos_i), t = sqrt_f(t2), bent = eta * eta * c;
    *cos_t = t / eta;
    return 0.5f * (sqr((c - t) / (c + t)) + sqr((bent - t) / (bent + t)));
}

LUCH_FN float f0_from_ior(float ior) { return sqr((ior - 1.0f) / (ior + 1.0f)); }
LUCH_FN float ior_from_f0(float f0) {
    float root = sqrt_f(clamp_f(f0, 0.0f, MOST_F0));
    return (1.0f + root) / (1.0f - root);
}

// Mean reflectance over the hemisphere, 2 cos F(cos). Fits of Kulla and Conty 2017, "Revisiting
// Physically Based Shading at Imageworks".
LUCH_FN float mean_fresnel_dielectric(float eta) {
    if (eta < 1.0f) return 0.997118f + eta * (0.1014f - eta * (0.965241f + eta * 0.130607f));
    return (eta - 1.0f) / (4.08567f + 1.00071f * eta);
}

LUCH_FN float fifth_power(float x) { return sqr(sqr(x)) * x; }

// F82: Schlick's curve less b cos (1 - cos)^6, which bends it around 82 degrees, where the cosine is
// 1/7. Source: Kutz, Hasan, Edmondson 2021, "Novel aspects of the Adobe Standard Material".
inline constexpr float F82_COSINE = 1.0f / 7.0f;
inline constexpr float F82_SIXTH = 46656.0f / 117649.0f;  // (6/7)^6

LUCH_FN float schlick_at_82(float f0) { return mix_f(f0, 1.0f, F82_SIXTH * (7.0f / 6.0f)); }
// b for a reflectance `f82` at 82 degrees; and for a tint there, relative to Schlick's curve.
LUCH_FN float f82_bend(float f0, float f82) { return (7.0f / F82_SIXTH) * (schlick_at_82(f0) - f82); }
LUCH_FN Color f82_bend_of_tint(Color f0, Color tint) {
    Color schlick = {schlick_at_82(f0.x), schlick_at_82(f0.y), schlick_at_82(f0.z)};
    return (7.0f / F82_SIXTH) * schlick * (make_vec3(1.0f) - tint);
}
LUCH_FN float fresnel_f82(float cosine, float f0, float b) {
    float s = saturate_f(1.0f - cosine);
    float s5 = fifth_power(s);
    return saturate_f(mix_f(f0, 1.0f, s5) - b * cosine * s5 * s);
}
LUCH_FN Color fresnel_f82(float cosine, Color f0, Color b) {
    float s = saturate_f(1.0f - cosine);
    float s5 = fifth_power(s), bend = cosine * s5 * s;
    Color f = f0 + (make_vec3(1.0f) - f0) * s5 - b * bend;
    return min_v(max_v(f, make_vec3(0.0f)), make_vec3(1.0f));
}
LUCH_FN Color mean_fresnel_f82(Color f0, Color b) {
    return mix(f0, make_vec3(1.0f), 1.0f / 21.0f) - b * (1.0f / 126.0f);
}

// sqrt((n + ik)^2 - outside^2 sin^2) = u + iv: the refracted wave in a conductor.
// Born and Wolf, Principles of Optics 14.4, with n + ik instead of n (1 + ik).
struct ConductorWave {
    float u, v, u2, v2;
};
LUCH_FN ConductorWave conductor_wave(float cos_i, float outside, float n, float k) {
    float re = n * n - k * k - outside * outside * (1.0f - cos_i * cos_i);
    float modulus = sqrt_f(re * re + sqr(2.0f * n * k));
    ConductorWave w;
    w.u2 = max_f(0.5f * (modulus + re), 0.0f);
    w.v2 = max_f(0.5f * (modulus - re), 0.0f);
    w.u = sqrt_f(w.u2);
    w.v = sqrt_f(w.v2);
    return w;
}
LUCH_FN Polarized conductor_reflectance(float cos_i, float outside, float n, float k, const ConductorWave& w) {
    float c = outside * cos_i;
    float p_re = (n * n - k * k) * cos_i, p_im = 2.0f * n * k * cos_i;
    return {safe_divide(sqr(c - w.u) + w.v2, sqr(c + w.u) + w.v2),
            safe_divide(sqr(p_re - outside * w.u) + sqr(p_im - outside * w.v),
                        sqr(p_re + outside * w.u) + sqr(p_im + outside * w.v))};
}
LUCH_FN float fresnel_conductor(float cos_i, float n, float k) {
    Polarized r = conductor_reflectance(cos_i, 1.0f, n, k, conductor_wave(cos_i, 1.0f, n, k));
    return 0.5f * (r.s + r.p);
}
LUCH_FN Color fresnel_conductor(float cos_i, Vec3 n, Vec3 k) {
    return {fresnel_conductor(cos_i, n.x, k.x), fresnel_conductor(cos_i, n.y, k.y), fresnel_conductor(cos_i, n.z, k.z)};
}
// Through the F82 curve that agrees at 0 and 82 degrees, whose mean is known.
LUCH_FN Color mean_fresnel_conductor(Vec3 n, Vec3 k) {
    Color f0 = fresnel_conductor(1.0f, n, k), f82 = fresnel_conductor(F82_COSINE, n, k);
    Color b = {f82_bend(f0.x, f82.x), f82_bend(f0.y, f82.y), f82_bend(f0.z, f82.z)};
    return min_v(max_v(mean_fresnel_f82(f0, b), make_vec3(0.0f)), make_vec3(1.0f));
}

}  // namespace luch

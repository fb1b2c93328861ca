// The medium under a surface: coefficients that give back the colour that was asked for, and the phase functions that
// a walk in it draws from.
#pragma once
#include "luch/math/bounds.h"
#include "luch/math/fn.h"
#include "luch/math/vec.h"
#include "luch/sampling/warp.h"

namespace luch {

struct Medium {
    Color extinction;  // per metre
    Color albedo;      // of one scattering
    float anisotropy;  // of the phase function, Henyey and Greenstein's g
};

// Single-scattering albedo of a half space of the given colour, exact in the isotropic limit to some 1e-3. Source:
// d'Eon, "A Hitchhiker's Guide to Multiple Scattering", equation 53.7 (after van de Hulst).
LUCH_FN float albedo_of_color(float color, float g) {
    float s = 4.09712f + 4.20863f * color - safe_sqrt(9.59217f + 41.6808f * color + 17.7126f * sqr(color));
    return safe_divide(1.0f - sqr(s), 1.0f - g * sqr(s));
}

LUCH_FN float polynomial(const float (&c)[8], float x) {
    float sum = c[7];
    for (int k = 6; k >= 0; --k) sum = sum * x + c[k];
    return sum;
}

// The same by the fit of Wrenninge, Villemin and Hery 2017 ("Path traced subsurface scattering using anisotropic phase
// functions and non-exponential free flights"), for 0 <= g <= 0.9: what Blender's older methods take.
LUCH_FN_SLOW float fitted_albedo_of_color(float color, float g) {
    constexpr float A[8] = {1.8260523782f,   -1.28451056436f, -1.79904629312f, 9.19393289202f,
                            -22.8215585862f, 32.0234874259f,  -23.6264803333f, 7.21067002658f};
    constexpr float B[8] = {0.0f,           31.1491581433f,  -201.847017512f, 841.576016723f, -2018.09288505f,
                            2731.71560286f, -1935.41424244f, 559.009054474f};
    constexpr float C[8] = {1.09686102424f, -0.394704063468f, 1.05258115941f, -8.83963712726f,
                            28.8643230661f, -46.8802913581f,  38.5402837518f, -12.7181042538f};
    constexpr float D[8] = {0.496310210422f, 0.360146581622f, -2.15139309747f, 17.8896899217f,
                            -55.2984010333f, 82.065982243f,   -58.5106008578f, 15.8478295021f};
    constexpr float E[8] = {0.0f,           76.7316253952f,  -594.356773233f, 2448.8834203f, -5576.68528998f,
                            7116.60171912f, -4763.54467887f, 1303.5318055f};
    constexpr float F[8] = {2.40602999408f, -2.51814844609f, 9.18494908356f, -79.2191708682f,
                            259.082868209f, -403.613804597f, 302.85712436f,  -87.4370473567f};
    float b = 4.98511194385f + 0.127355959438f * exp_f(polynomial(B, g));
    float e = 4.23190299701f + 0.00310603949088f * exp_f(polynomial(E, g));
    float dark = polynomial(A, g) * pow_f(atan_f(b * color), polynomial(C, g));
    float bright = polynomial(D, g) * pow_f(atan_f(e * color), polynomial(F, g));
    float blend = sqrt_f(sqrt_f(color));
    return (1.0f - blend) * dark + blend * bright;
}

// One channel: *light is darkened where the albedo is raised to the least.
LUCH_FN float channel_albedo(float color, float g, bool fitted, float* light) {
    float albedo = fitted ? fitted_albedo_of_color(color, g) : albedo_of_color(color, g);
    albedo = clamp_f(albedo, 0.0f, MEDIUM_MAX_ALBEDO);
    if (albedo < MEDIUM_MIN_ALBEDO) *light *= albedo / MEDIUM_MIN_ALBEDO;
    return max_f(albedo, MEDIUM_MIN_ALBEDO);
}

LUCH_FN float channel_extinction(float mean_free_path, float scale) {
    return scale / max_f(mean_free_path, SMALLEST_FREE_PATH);
}

// older: the mapping of Blender's older methods, whose radius is that of isotropic scattering.
// *light: changed where the albedo has to be.
LUCH_FN Medium medium_of(Color color, Vec3 radius, float g, bool older, Color* light) {
    bool fitted = older && !(g < 0.0f);  // the fit knows no backward scattering
    float scale = fitted ? 1.0f / (1.0f - g) : 1.0f;
    return {
        {channel_extinction(radius.x, scale), channel_extinction(radius.y, scale), channel_extinction(radius.z, scale)},
        {channel_albedo(color.x, g, fitted, &light->x), channel_albedo(color.y, g, fitted, &light->y),
         channel_albedo(color.z, g, fitted, &light->z)},
        g};
}

// Density of the phase function, per steradian; cosine: between the directions of flight before and after.
LUCH_FN float henyey_greenstein(float cosine, float g) {
    if (abs_f(g) < ISOTROPIC_BELOW) return 0.25f * INV_PI;
    float k = 1.0f + sqr(g) - 2.0f * g * cosine;
    return 0.25f * INV_PI * (1.0f - sqr(g)) / max_f(k * sqrt_f(k), 1e-20f);
}
// A cosine of that density. u in [0, 1).
LUCH_FN float sample_henyey_greenstein(float g, float u) {
    if (abs_f(g) < ISOTROPIC_BELOW) return 1.0f - 2.0f * u;
    float k = (1.0f - sqr(g)) / (1.0f - g + 2.0f * g * u);
    return clamp_f((1.0f + sqr(g) - sqr(k)) / (2.0f * g), -1.0f, 1.0f);
}

// Guided walks prefer directions that lead back to the surface (Krivanek and d'Eon 2014, "A zero-variance-based sampling
// scheme for Monte Carlo subsurface scattering"): by the diffusion length, in mean free paths, of d'Eon and Krivanek 2020.
struct Guide {
    float length;     // > 1
    float log_ratio;  // log((length + 1) / (length - 1))
};
LUCH_FN Guide guide_of(float albedo) {
    float power = pow_f(albedo, 2.44294f - 0.0215813f * albedo + 0.578637f / albedo);
    float length = 1.0f / sqrt_f(max_f(1.0f - power, LEAST_DIFFUSION));
    return {length, log_f((length + 1.0f) / (length - 1.0f))};
}
// Density per steradian around the normal (Meng, Hanika and Dachsbacher 2016, equations 9 and 10).
LUCH_FN float guided_pdf(const Guide& guide, float cosine) {
    return 0.5f * INV_PI / ((guide.length - cosine) * guide.log_ratio);
}
LUCH_FN float sample_guided(const Guide& guide, float u) {
    float cosine = guide.length - (guide.length + 1.0f) * exp_f(-u * guide.log_ratio);
    return clamp_f(cosine, -1.0f, 1.0f);
}

LUCH_FN Vec3 direction_at(Vec3 axis, float cosine, float turns) {
    Vec3 t, b;
    make_frame(axis, &t, &b);
    float s, c, sine = safe_sqrt(1.0f - sqr(cosine));
    sincos_turns(turns, &s, &c);
    return to_world({sine * c, sine * s, cosine}, t, b, axis);
}

}  // namespace luch

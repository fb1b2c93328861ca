// The Beckmann distribution's own parts: masking and the sampling of visible normals.
#pragma once
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

// Abramowitz and Stegun 7.1.26, absolute error 1.5e-7; odd.
LUCH_FN float erf_f(float x) {
    float a = abs_f(x), t = 1.0f / (1.0f + 0.3275911f * a);
    float p = ((((1.061405429f * t - 1.453152027f) * t + 1.421413741f) * t - 0.284496736f) * t + 0.254829592f) * t;
    return copysign_f(1.0f - p * exp_f(-a * a), x);
}

// Giles 2010, "Approximating the erfinv function", single precision; x in (-1, 1).
LUCH_FN float erf_inverse_f(float x) {
    x = clamp_f(x, -ERF_INVERSE_END, ERF_INVERSE_END);
    float w = -log_f((1.0f - x) * (1.0f + x));
    float p;
    if (w < 5.0f) {
        w -= 2.5f;
        p = 2.81022636e-08f;
        p = 3.43273939e-07f + p * w;
        p = -3.5233877e-06f + p * w;
        p = -4.39150654e-06f + p * w;
        p = 0.00021858087f + p * w;
        p = -0.00125372503f + p * w;
        p = -0.00417768164f + p * w;
        p = 0.246640727f + p * w;
        p = 1.50140941f + p * w;
    } else {
        w = sqrt_f(w) - 3.0f;
        p = -0.000200214257f;
        p = 0.000100950558f + p * w;
        p = 0.00134934322f + p * w;
        p = -0.00367342844f + p * w;
        p = 0.00573950773f + p * w;
        p = -0.0076224613f + p * w;
        p = 0.00943887047f + p * w;
        p = 1.00167406f + p * w;
        p = 2.83297682f + p * w;
    }
    return p * x;
}

// Smith's lambda from (alpha tan)^2: the usual rational fit (Walter et al. 2007) that pictures are
// compared with, and the exact one that visible normals follow.
LUCH_FN float beckmann_lambda(float alpha2_tan2) {
    if (alpha2_tan2 < 0.39f) return 0.0f;
    float a = 1.0f / sqrt_f(alpha2_tan2);
    return ((0.396f * a - 1.259f) * a + 1.0f) / ((2.181f * a + 3.535f) * a);
}
LUCH_FN float beckmann_lambda_exact(float alpha2_tan2) {
    if (alpha2_tan2 < BECKMANN_NO_SHADOW) return 0.0f;
    float a = 1.0f / sqrt_f(alpha2_tan2);
    return 0.5f * (erf_f(a) - 1.0f + exp_f(-a * a) * 0.56418958354f / a);
}

// Slope towards the viewer, x, of the unit-roughness surface seen under the angle of cotangent
// `cot`: inverts the distribution of visible slopes, 1 + erf(x) + K exp(-x^2) = target, in b = erf(x)
// by Newton steps that fall back to bisection. Source: Jakob 2014, "An Improved Visible Normal
// Sampling Routine for the Beckmann Distribution".
LUCH_FN_SLOW float sample_beckmann_slope(float cot, float u) {
    float tan = 1.0f / cot, edge = erf_f(cot);
    float k = tan * 0.56418958354f;  // tan / sqrt(pi)
    float whole = 1.0f + edge + k * exp_f(-cot * cot);
    float target = u * whole;
    float low = -1.0f, high = edge;
    float b = 0.5f * (low + high), x = 0.0f;
    for (int step = 0; step < 12; ++step) {
        x = erf_inverse_f(b);
        float excess = 1.0f + b + k * exp_f(-x * x) - target;
        if (abs_f(excess) < BECKMANN_TOLERANCE * whole) break;
        if (excess > 0.0f) {
            high = b;
        } else {
            low = b;
        }
        float newton = b - excess / (1.0f - x * tan);
        b = newton > low && newton < high ? newton : 0.5f * (low + high);
    }
    return x;
}

LUCH_FN_SLOW Vec3 sample_visible_beckmann(Vec3 o, float alpha_x, float alpha_y, Vec2 u) {
    Vec3 s = normalize(make_vec3(alpha_x * o.x, alpha_y * o.y, o.z));
    float sin_o = safe_sqrt(1.0f - s.z * s.z);
    float x, y;
    if (sin_o < BECKMANN_HEAD_ON_SINE) {  // seen straight on: all slopes are equally visible
        float r = sqrt_f(-log_f(max_f(1.0f - u.x, 1e-30f)));
        float sine, cosine;
        sincos_turns(u.y, &sine, &cosine);
        x = r * cosine;
        y = r * sine;
    } else {
        float along = sample_beckmann_slope(s.z / sin_o, u.x), across = erf_inverse_f(2.0f * u.y - 1.0f);
        float c = s.x / sin_o, d = s.y / sin_o;
        x = c * along - d * across;
        y = d * along + c * across;
    }
    return normalize(make_vec3(-alpha_x * x, -alpha_y * y, 1.0f));
}

}  // namespace luch

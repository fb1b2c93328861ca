// Maps from the unit square to the shapes that are sampled. All are area-preserving up to the
// stated density and keep strata whole.
#pragma once
#include "luch/math/fn.h"

namespace luch {

inline constexpr float HALF_PI = 1.57079632679489661923f;
inline constexpr float QUARTER_PI = 0.78539816339744830962f;

// Sine and cosine of a number of turns in [0, 1]: no reduction of large angles is needed.
LUCH_FN void sincos_turns(float turns, float* sine, float* cosine) {
    float quarter = floor_f(4.0f * turns + 0.5f);
    float rest = TWO_PI * (turns - 0.25f * quarter);  // within pi/4 of 0, and exact before the product
    float s = sin_near_zero(rest), c = cos_near_zero(rest);
    u32 n = static_cast<u32>(static_cast<i32>(quarter));
    float a = (n & 1u) ? c : s, b = (n & 1u) ? s : c;
    *sine = (n & 2u) ? -a : a;
    *cosine = ((n + 1u) & 2u) ? -b : b;
}

// Uniform on the unit disk (Shirley and Chiu 1997). Density 1/pi.
LUCH_FN Vec2 sample_disk(Vec2 u) {
    float a = 2.0f * u.x - 1.0f, b = 2.0f * u.y - 1.0f;
    bool wide = a * a > b * b;
    float r = wide ? a : b;
    // Within pi/4 of the nearer axis; the centre maps to itself: r = 0.
    float angle = QUARTER_PI * safe_divide(wide ? b : a, r);
    float along = r * cos_near_zero(angle), across = r * sin_near_zero(angle);
    return {wide ? along : across, wide ? across : along};
}

// Uniform on the regular polygon inscribed in the unit circle, one edge facing `rotation`.
LUCH_FN Vec2 sample_polygon(float corners, float rotation, Vec2 u) {
    float scaled = u.x * corners;
    float corner = min_f(floor_f(scaled), corners - 1.0f);  // u.x * corners may round up to corners
    float a = sqrt_f(scaled - corner);
    float b = u.y * a;
    a = 1.0f - a;
    float half_angle = PI / corners;
    float px = (a + b) * cos_f(half_angle), py = (a - b) * sin_f(half_angle);
    float angle = rotation + corner * 2.0f * half_angle;
    float c = cos_f(angle), s = sin_f(angle);
    return {c * px - s * py, s * px + c * py};
}

// Around +z, density cos(theta) / pi.
LUCH_FN Vec3 sample_cosine_hemisphere(Vec2 u) {
    Vec2 d = sample_disk(u);
    return {d.x, d.y, safe_sqrt(1.0f - d.x * d.x - d.y * d.y)};
}

// Around +z, density 1 / (2 pi).
LUCH_FN Vec3 sample_uniform_hemisphere(Vec2 u) {
    Vec2 d = sample_disk(u);
    float r2 = d.x * d.x + d.y * d.y;
    float scale = safe_sqrt(2.0f - r2);
    return {d.x * scale, d.y * scale, max_f(1.0f - r2, 0.0f)};
}

// Density 1 / (4 pi).
LUCH_FN Vec3 sample_uniform_sphere(Vec2 u) {
    float z = 1.0f - 2.0f * u.x;
    float r = safe_sqrt(1.0f - z * z);
    float phi = TWO_PI * u.y;
    return {r * cos_f(phi), r * sin_f(phi), z};
}

// Around +z within the cone of the given 1 - cos(half angle), which keeps tiny cones exact where the
// cosine would round to 1. Density 1 / (2 pi one_minus_cos); an empty cone gives the axis.
LUCH_FN Vec3 sample_cone(float one_minus_cos, Vec2 u) {
    Vec2 d = sample_disk(u);
    float r2 = d.x * d.x + d.y * d.y;
    float scale = safe_sqrt(one_minus_cos * (2.0f - one_minus_cos * r2));
    return {d.x * scale, d.y * scale, 1.0f - r2 * one_minus_cos};
}

// Barycentrics (u, v) of a uniform point: p = (1-u-v) p0 + u p1 + v p2 (Heitz 2019, low distortion).
LUCH_FN Vec2 sample_triangle(Vec2 u) {
    bool below = u.x < u.y;
    float half_small = 0.5f * (below ? u.x : u.y);
    float rest = (below ? u.y : u.x) - half_small;
    float b0 = below ? half_small : rest, b1 = below ? rest : half_small;
    return {b1, max_f(1.0f - b0 - b1, 0.0f)};
}

}  // namespace luch

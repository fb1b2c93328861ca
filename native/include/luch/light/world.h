// Directions towards the world: uniform or cosine for a constant one, an importance map otherwise, and a cone
// around the sun of a sky. The map's density is bilinear between texel centres, as the environment image
// itself is looked up: a lone hot texel is sampled in proportion to its whole tent, not to its own square.
//
// Direction convention (Blender's equirectangular): texel (x, y) of a W by H map looks along longitude
// pi - 2 pi (x + 1/2) / W, latitude pi ((y + 1/2) / H - 1/2).
#pragma once
#include "luch/light/light.h"
#include "luch/math/bounds.h"
#include "luch/sampling/warp.h"

namespace luch {

LUCH_FN Vec3 equirectangular_direction(float u, float v) {
    float longitude = PI - TWO_PI * u, latitude = PI * (v - 0.5f);
    float c = cos_f(latitude);
    return {c * cos_f(longitude), c * sin_f(longitude), sin_f(latitude)};
}

// Index of the interval of a rising table (count + 1 entries, table[0] = 0) that holds x, and where in it (0..1).
LUCH_FN u32 find_interval(const float* table, u32 count, float x, float* within) {
    u32 low = 0, high = count;
    while (high - low > 1u) {
        u32 middle = (low + high) >> 1;
        bool right = table[middle] <= x;
        low = right ? middle : low;
        high = right ? high : middle;
    }
    *within = clamp_f(safe_divide(x - table[low], table[low + 1] - table[low]), 0.0f, 1.0f);
    return low;
}

// x in [0, 1] with density from a (at 0) to b (at 1), linear.
LUCH_FN float sample_linear(float u, float a, float b) {
    float weight = a + sqrt_f(mix_f(a * a, b * b, u));
    return weight > 0.0f ? min_f(u * (a + b) / weight, 1.0f) : u;
}

// The four texel densities around cell (column, row): rows 0 and height are the half cells at the poles.
struct WorldCell {
    float d00, d10, d01, d11;
};
LUCH_FN WorldCell world_cell(const WorldLight& w, u32 column, u32 row) {
    u32 below = row == 0u ? 0u : row - 1u, above = row == w.height ? row - 1u : row;
    u32 right = column + 1u == w.width ? 0u : column + 1u;
    const float* a = w.density + static_cast<u64>(below) * w.width;
    const float* b = w.density + static_cast<u64>(above) * w.width;
    return {a[column], a[right], b[column], b[right]};
}

LUCH_FN float world_map_pdf(const WorldLight& w, Vec3 d) {
    float cos_latitude = sqrt_f(d.x * d.x + d.y * d.y);
    float u = 0.5f - atan2_f(d.y, d.x) * (1.0f / TWO_PI);
    float v = 0.5f + atan2_f(d.z, cos_latitude) * INV_PI;
    float x = u * static_cast<float>(w.width) - 0.5f, y = v * static_cast<float>(w.height) + 0.5f;
    float column = floor_f(x), row = clamp_f(floor_f(y), 0.0f, static_cast<float>(w.height));
    float fx = x - column, fy = saturate_f(y - row);
    u32 c = column < 0.0f ? w.width - 1u : static_cast<u32>(column);
    c = c >= w.width ? c - w.width : c;
    WorldCell cell = world_cell(w, c, static_cast<u32>(row));
    float density = mix_f(mix_f(cell.d00, cell.d10, fx), mix_f(cell.d01, cell.d11, fx), fy);
    float jacobian = 2.0f * PI * PI * cos_latitude;
    return jacobian > 0.0f ? density / jacobian : 0.0f;
}

LUCH_FN_SLOW Vec3 sample_world_map(const WorldLight& w, Vec2 u) {
    float in_row, in_column;
    u32 row = find_interval(w.row_cdf, w.height + 1u, u.y, &in_row);
    u32 column = find_interval(w.column_cdf + static_cast<u64>(row) * (w.width + 1u), w.width, u.x, &in_column);
    WorldCell cell = world_cell(w, column, row);
    float fy = sample_linear(in_row, cell.d00 + cell.d10, cell.d01 + cell.d11);
    float fx = sample_linear(in_column, mix_f(cell.d00, cell.d01, fy), mix_f(cell.d10, cell.d11, fy));
    float x = (static_cast<float>(column) + fx + 0.5f) / static_cast<float>(w.width);
    float low = row == 0u ? 0.0f : static_cast<float>(row) - 0.5f;
    float size = (row == 0u || row == w.height) ? 0.5f : 1.0f;
    return equirectangular_direction(x, (low + fy * size) / static_cast<float>(w.height));
}

LUCH_FN float world_uniform_pdf(Vec3 n, bool transmits, Vec3 d) {
    if (is_zero(n)) return 0.25f * INV_PI;
    float c = dot(n, d);
    return transmits ? 0.5f * INV_PI * abs_f(c) : max_f(c, 0.0f) * INV_PI;
}

LUCH_FN_SLOW Vec3 sample_world_uniform(Vec3 n, bool transmits, Vec2 u) {
    if (is_zero(n)) return sample_uniform_sphere(u);
    Vec3 t, b;
    make_frame(n, &t, &b);
    bool behind = transmits && u.x >= 0.5f;
    if (transmits) u.x = 2.0f * u.x - (behind ? 1.0f : 0.0f);
    Vec3 local = sample_cosine_hemisphere(u);
    return to_world({local.x, local.y, behind ? -local.z : local.z}, t, b, n);
}

LUCH_FN bool in_world_sun(const WorldLight& w, Vec3 d) {
    return length_squared(d - w.sun_direction) <= 2.0f * w.sun_one_minus_cos;
}

// Irradiance of the sun of a sky on a surface with this normal; 0 only where it stands below the horizon.
LUCH_FN float world_sun_irradiance(const WorldLight& w, Vec3 n, bool transmits) {
    float c = dot(n, w.sun_direction);
    c = transmits ? abs_f(c) : c;
    float sine = safe_sqrt(w.sun_one_minus_cos * (2.0f - w.sun_one_minus_cos));
    return w.sun_irradiance * (is_zero(n) ? 1.0f : clamp_f(c + sine, 0.0f, 1.0f));
}

// The sun's share of the samples. The even part of the sky is found by rays.
LUCH_FN float world_sun_probability(const WorldLight& w, Vec3 n, bool transmits) {
    float sun = world_sun_irradiance(w, n, transmits);
    return WORLD_SUN_MOST * safe_divide(sun, sun + w.map_irradiance);
}

// Density of sample_world at d, the world being chosen.
LUCH_FN_SLOW float world_direction_pdf(const WorldLight& w, Vec3 n, bool transmits, Vec3 d) {
    float pdf = w.constant ? world_uniform_pdf(n, transmits, d) : world_map_pdf(w, d);
    if (!w.has_sun) return pdf;
    float sun = in_world_sun(w, d) ? 1.0f / (TWO_PI * w.sun_one_minus_cos) : 0.0f;
    return mix_f(pdf, sun, world_sun_probability(w, n, transmits));
}

LUCH_FN_SLOW Vec3 sample_world(const WorldLight& w, Vec3 n, bool transmits, Vec2 u) {
    if (w.has_sun) {
        float probability = world_sun_probability(w, n, transmits);
        if (u.x < probability) {
            Vec3 t, b;
            make_frame(w.sun_direction, &t, &b);
            return to_world(sample_cone(w.sun_one_minus_cos, {u.x / probability, u.y}), t, b, w.sun_direction);
        }
        u.x = min_f((u.x - probability) / (1.0f - probability), BELOW_ONE);
    }
    return w.constant ? sample_world_uniform(n, transmits, u) : sample_world_map(w, u);
}

}  // namespace luch

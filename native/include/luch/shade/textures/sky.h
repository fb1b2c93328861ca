// Sky Texture. The tables are made by luch/sky.py.
//
// operation        inputs                  outputs     params
// SKY_ATMOSPHERE   0..2 direction (unit)   0..2 color  0 table offset (see SkyAtmosphere)
// SKY_PREETHAM     the same                the same    0 table offset (see SkyPreetham)
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/scene_view.h"

namespace luch {

// CIE XYZ to scene-linear Rec.709, nothing negative.
LUCH_FN Vec3 xyz_to_color(Vec3 c) {
    return {max_f(3.2404542f * c.x - 1.5371385f * c.y - 0.4985314f * c.z, 0.0f),
            max_f(-0.9692660f * c.x + 1.8760108f * c.y + 0.0415560f * c.z, 0.0f),
            max_f(0.0556434f * c.x - 0.2040259f * c.y + 1.0572252f * c.z, 0.0f)};
}

// What a direction that is not finite stands for: straight up.
LUCH_FN Vec3 sky_direction(const float* in) {
    const Vec3 d{in[0], in[1], in[2]};
    return finite_v(d) ? d : make_vec3(0.0f, 0.0f, 1.0f);
}

// Single and multiple scattering: a table of the sky's XYZ radiance by azimuth from the sun and by
// elevation, finer towards the horizon, and the sun's disc in front of it.
struct SkyAtmosphere {
    static constexpr int COLUMNS = 512, ROWS = 256;  // of the full circle; the left half is stored
    float sun_bottom[3], sun_top[3];                 // XYZ radiance of the disc's lower and upper end
    float sun_direction[3];                          // unit
    float sun_elevation, sun_rotation;               // radians
    float sun_diameter;                              // radians; negative: no disc
    float sun_strength;
    float horizon;  // elevation below which the ground hides the disc
    float sky[ROWS][COLUMNS / 2][3];
};

struct OpSkyAtmosphere {
    static constexpr int inputs = 3, outputs = 3, params = 1;

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        const auto& sky = *reinterpret_cast<const SkyAtmosphere*>(table_of(c, params[0]));
        const Vec3 d = sky_direction(in);
        const float elevation = 0.5f * PI - acos_f(d.z);
        const Vec3 color = xyz_to_color(sun_disc(sky, d, elevation) + scattered(sky, d, elevation));
        out[0] = color.x;
        out[1] = color.y;
        out[2] = color.z;
    }

 private:
    LUCH_FN static Vec3 sun_disc(const SkyAtmosphere& sky, Vec3 d, float elevation) {
        const Vec3 sun{sky.sun_direction[0], sky.sun_direction[1], sky.sun_direction[2]};
        const float angle = 2.0f * atan2_f(length(d - sun), length(d + sun));  // exact for small angles
        const float radius = 0.5f * sky.sun_diameter;
        if (!(angle < radius && elevation > sky.horizon)) return make_vec3(0.0f);
        const float height = (elevation - sky.sun_elevation) / sky.sun_diameter + 0.5f;
        const float limb = 1.0f - 0.6f * (1.0f - safe_sqrt(1.0f - sqr(angle / radius)));
        const Vec3 bottom{sky.sun_bottom[0], sky.sun_bottom[1], sky.sun_bottom[2]};
        const Vec3 top{sky.sun_top[0], sky.sun_top[1], sky.sun_top[2]};
        return mix(bottom, top, height) * (sky.sun_strength * limb);
    }

    LUCH_FN static Vec3 scattered(const SkyAtmosphere& sky, Vec3 d, float elevation) {
        const float azimuth = atan2_f(d.y, d.x);
        const float u = fract_f((sky.sun_rotation - azimuth - 0.5f * PI) * (0.5f * INV_PI));
        const float v = 0.5f + 0.5f * copysign_f(sqrt_f(abs_f(elevation) * (2.0f * INV_PI)), elevation);
        const float x = u * float(SkyAtmosphere::COLUMNS) - 0.5f, y = v * float(SkyAtmosphere::ROWS) - 0.5f;
        const float x0 = floor_f(x), y0 = floor_f(y);
        const int i = int(x0), j = int(y0);
        return mix(mix(texel(sky, i, j), texel(sky, i + 1, j), x - x0),
                   mix(texel(sky, i, j + 1), texel(sky, i + 1, j + 1), x - x0), y - y0);
    }

    // The right half of the sky mirrors the left one.
    LUCH_FN static Vec3 texel(const SkyAtmosphere& sky, int x, int y) {
        constexpr int columns = SkyAtmosphere::COLUMNS, rows = SkyAtmosphere::ROWS;
        x = x < 0 ? 0 : (x >= columns ? columns - 1 : x);
        y = y < 0 ? 0 : (y >= rows ? rows - 1 : y);
        const float* t = sky.sky[y][x < columns / 2 ? x : columns - 1 - x];
        return {t[0], t[1], t[2]};
    }
};

// Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight", 1999.
struct SkyPreetham {
    float sun_theta, sun_phi;  // radians from the zenith, from +Y towards +X
    float zenith[3];           // Y, x, y over the Perez function at the zenith
    float perez[3][5];         // A to E of Y, x, y
};

struct OpSkyPreetham {
    static constexpr int inputs = 3, outputs = 3, params = 1;

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        const auto& sky = *reinterpret_cast<const SkyPreetham*>(table_of(c, params[0]));
        const Vec3 d = sky_direction(in);
        const float theta = acos_f(d.z), phi = 0.5f * PI - atan2_f(d.y, d.x);
        const float cos_gamma =
            sin_f(theta) * sin_f(sky.sun_theta) * cos_f(sky.sun_phi - phi) + cos_f(theta) * cos_f(sky.sun_theta);
        const float gamma = acos_f(cos_gamma);
        const float above = min_f(theta, 0.5f * PI - SKY_HORIZON);  // below the horizon, the horizon's colour
        float v[3];                                            // Y, x, y
        for (int k = 0; k < 3; k++) v[k] = sky.zenith[k] * perez(sky.perez[k], above, gamma);
        const float scale = v[2] != 0.0f ? v[0] / v[2] : 0.0f;
        const Vec3 color = xyz_to_color({v[1] * scale, v[0], (1.0f - v[1] - v[2]) * scale});
        out[0] = color.x;
        out[1] = color.y;
        out[2] = color.z;
    }

 private:
    LUCH_FN static float perez(const float (&c)[5], float theta, float gamma) {
        return (1.0f + c[0] * exp_f(c[1] / cos_f(theta))) *
               (1.0f + c[2] * exp_f(c[3] * gamma) + c[4] * sqr(cos_f(gamma)));
    }
};

}  // namespace luch

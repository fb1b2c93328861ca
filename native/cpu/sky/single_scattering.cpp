// The atmosphere with one bounce of sunlight, at 21 wavelengths. Lengths in metres.
// Source: Nishita et al., "Display of the Earth Taking into Account Atmospheric Scattering", 1993, in
// spectral form, with ozone as a layer around 25 km.
#include <algorithm>
#include <cmath>

#include "cpu/sky/atmosphere.h"
#include "luch/math/fn.h"

namespace luch::cpu {
namespace {

constexpr int BANDS = 21, STEPS = 32;
constexpr double EARTH_RADIUS = 6360e3, ATMOSPHERE_RADIUS = 6420e3, HIGHEST = 59999.0;
constexpr float AIR_HEIGHT = 8000.0f, AEROSOL_HEIGHT = 1200.0f;  // over which densities fall to 1/e
constexpr float OZONE_CENTRE = 25000.0f, OZONE_HALF_WIDTH = 15000.0f;
constexpr float AEROSOL_SCATTERING = 2e-5f, AEROSOL_EXTINCTION = 1.11f * 2e-5f;  // 1 / m
constexpr float AEROSOL_G = 0.76f;

// Gauss-Laguerre quadrature of order 8 for depths that fall off along a ray: nodes x / 25, so that the
// last one, 22.9, lies inside, and weights w exp(x) / 25.
constexpr int NODES = 8;
constexpr double NODE[NODES] = {0.006811185292, 0.03614807107, 0.09004346519, 0.1706680068,
                                0.2818362161,   0.4303406404,  0.6296271457,  0.9145252695};
constexpr float NODE_WEIGHT[NODES] = {0.01750893642f, 0.04135477391f, 0.06678839063f, 0.09507698807f,
                                      0.1283416365f,  0.1707430204f,  0.2327233347f,  0.3562490486f};

// CIE 1931 observer at 380, 400, ... 780 nm.
constexpr float OBSERVER[BANDS][3] = {{0.001368f, 0.000039f, 0.006450001f},
                                      {0.01431f, 0.000396f, 0.06785001f},
                                      {0.13438f, 0.004f, 0.6456f},
                                      {0.34828f, 0.023f, 1.74706f},
                                      {0.2908f, 0.06f, 1.6692f},
                                      {0.09564f, 0.13902f, 0.8129501f},
                                      {0.0049f, 0.323f, 0.272f},
                                      {0.06327f, 0.71f, 0.07824999f},
                                      {0.2904f, 0.954f, 0.0203f},
                                      {0.5945f, 0.995f, 0.0039f},
                                      {0.9163f, 0.87f, 0.001650001f},
                                      {1.0622f, 0.631f, 0.0008f},
                                      {0.8544499f, 0.381f, 0.00019f},
                                      {0.4479f, 0.175f, 0.00002f},
                                      {0.1649f, 0.061f, 0.0f},
                                      {0.04677f, 0.017f, 0.0f},
                                      {0.01135916f, 0.004102f, 0.0f},
                                      {0.002899327f, 0.001047f, 0.0f},
                                      {0.0006900786f, 0.0002492f, 0.0f},
                                      {0.0001661505f, 0.00006f, 0.0f},
                                      {0.00004150994f, 0.00001499f, 0.0f}};
// Absorption of the densest ozone (cross-sections of Serdyuchenko et al. 2014), 1e-7 / m.
constexpr float OZONE_ABSORPTION[BANDS] = {
    0.0325126850f, 0.0585395365f, 0.197719116f, 0.730956876f, 2.00845625f, 4.03839581f, 6.35513359f,
    9.67070412f,   15.4797400f,   20.9038647f,  24.6128056f,  27.3551299f, 21.5125863f, 15.9051841f,
    11.2356198f,   7.35275515f,   4.64501304f,  3.30960799f,  2.25126123f, 1.48791293f, 1.68286234f};

struct Spectra {
    float air[BANDS], ozone[BANDS];  // 1 / m at full density
    float xyz[BANDS][3];             // the sun's irradiance times the observer times the step of 20 nm

    Spectra() {
        constexpr double h = 6.62607015e-34, c = 299792458.0, k = 1.380649e-23, sun_kelvin = 5778.0;
        const double sun_solid_angle = double(PI) * std::pow(6.955e8 / 1.496e11, 2.0);
        for (int b = 0; b < BANDS; b++) {
            const double metres = (380.0 + 20.0 * b) * 1e-9;
            const double planck =
                2.0 * h * c * c * 1e-9 / (std::pow(metres, 5.0) * std::expm1(h * c / (metres * k * sun_kelvin)));
            air[b] = float(1.13115e-30 / std::pow(metres, 4.0));
            ozone[b] = OZONE_ABSORPTION[b] * 1e-7f;
            for (int i = 0; i < 3; i++) xyz[b][i] = float(planck * sun_solid_angle * 20.0) * OBSERVER[b][i];
        }
    }
};

// Of air, aerosol and ozone, relative to where each is densest; or the same integrated over metres.
struct Depth {
    float air, aerosol, ozone;
};

Depth density_at(double r) {
    const float h = float(r - EARTH_RADIUS);
    const float ozone = 1.0f - abs_f(h - OZONE_CENTRE) * (1.0f / OZONE_HALF_WIDTH);
    return {exp_f(h * (-1.0f / AIR_HEIGHT)), exp_f(h * (-1.0f / AEROSOL_HEIGHT)), max_f(ozone, 0.0f)};
}

// Out of the atmosphere; cosine of the ray's angle from the zenith.
Depth depth_to_sun(double r, double cosine) {
    const double b = r * cosine;
    const double length = std::sqrt(b * b - r * r + ATMOSPHERE_RADIUS * ATMOSPHERE_RADIUS) - b;
    Depth sum{0.0f, 0.0f, 0.0f};
    for (int n = 0; n < NODES; n++) {
        const double t = NODE[n] * length;
        const Depth d = density_at(std::sqrt(r * r + 2.0 * b * t + t * t));
        sum = {sum.air + d.air * NODE_WEIGHT[n], sum.aerosol + d.aerosol * NODE_WEIGHT[n],
               sum.ozone + d.ozone * NODE_WEIGHT[n]};
    }
    return {sum.air * float(length), sum.aerosol * float(length), sum.ozone * float(length)};
}

class SkyRow {
 public:
    SkyRow(const AtmosphereSettings& s, const Spectra& spectra) : settings_(s), spectra_(spectra) {
        sun_x_ = std::cos(s.sun_elevation);
        sun_z_ = std::sin(s.sun_elevation);
        observer_ = EARTH_RADIUS + std::clamp(s.altitude, 1.0, HIGHEST);
    }

    // out: SKY_COLUMNS x 3.
    void compute(double elevation, float* out) {
        start(elevation);
        const double up = std::sin(elevation), b = observer_ * up;
        const double end = std::sqrt(b * b - observer_ * observer_ + ATMOSPHERE_RADIUS * ATMOSPHERE_RADIUS) - b;
        const double step = end / STEPS;
        Depth seen{0.0f, 0.0f, 0.0f};
        for (int k = 0; k < STEPS; k++) {
            const double t = (k + 0.5) * step;
            const double r = std::sqrt(observer_ * observer_ + 2.0 * b * t + t * t);
            Depth density = density_at(r);
            density = {density.air * float(settings_.air), density.aerosol * float(settings_.aerosol),
                       density.ozone * float(settings_.ozone)};
            seen = {seen.air + density.air * float(step), seen.aerosol + density.aerosol * float(step),
                    seen.ozone + density.ozone * float(step)};
            scatter(t, r, seen);
            add_bands(density, float(step));
        }
        for (int column = 0; column < SKY_COLUMNS; column++) {
            for (int i = 0; i < 3; i++) {
                float sum = 0.0f;
                for (int band = 0; band < BANDS; band++) sum += light_[band][column] * spectra_.xyz[band][i];
                out[3 * column + i] = sum;
            }
        }
    }

 private:
    void start(double elevation) {
        constexpr float g2 = AEROSOL_G * AEROSOL_G;
        for (int column = 0; column < SKY_COLUMNS; column++) {
            const double azimuth = double(PI) * column / SKY_COLUMNS - double(PI);
            const double to_sun = std::cos(elevation) * std::cos(azimuth) * sun_x_ + std::sin(elevation) * sun_z_;
            const float mu = float(to_sun), bright = 1.0f + mu * mu;
            const float width = 1.0f + g2 - 2.0f * AEROSOL_G * mu;
            to_sun_[column] = to_sun;
            air_phase_[column] = 3.0f / (16.0f * PI) * bright;
            aerosol_phase_[column] =
                3.0f * (1.0f - g2) * bright / (8.0f * PI * (2.0f + g2) * width * std::sqrt(width)) * AEROSOL_SCATTERING;
        }
        for (auto& band : light_) std::fill(band, band + SKY_COLUMNS, 0.0f);
    }

    // Depth of the way to the sun and on to the observer, for every column.
    void scatter(double t, double r, const Depth& seen) {
        for (int column = 0; column < SKY_COLUMNS; column++) {
            const double along = observer_ * sun_z_ + to_sun_[column] * t;
            const Depth d = depth_to_sun(r, along / r);
            const bool shadow = sun_z_ < 0.0 && along * along >= r * r - EARTH_RADIUS * EARTH_RADIUS;
            lit_[column] = shadow ? 0.0f : 1.0f;
            depth_[0][column] = seen.air + d.air * float(settings_.air);
            depth_[1][column] = (seen.aerosol + d.aerosol * float(settings_.aerosol)) * AEROSOL_EXTINCTION;
            depth_[2][column] = seen.ozone + d.ozone * float(settings_.ozone);
        }
    }

    void add_bands(const Depth& density, float step) {
        for (int band = 0; band < BANDS; band++) {
            const float air = spectra_.air[band], ozone = spectra_.ozone[band];
            const float by_air = density.air * air * step, by_aerosol = density.aerosol * step;
            float* __restrict light = light_[band];
            for (int column = 0; column < SKY_COLUMNS; column++) {
                const float depth = depth_[0][column] * air + depth_[1][column] + depth_[2][column] * ozone;
                const float scattered = air_phase_[column] * by_air + aerosol_phase_[column] * by_aerosol;
                light[column] += lit_[column] * exp_f(-depth) * scattered;
            }
        }
    }

    const AtmosphereSettings& settings_;
    const Spectra& spectra_;
    double sun_x_, sun_z_, observer_;
    double to_sun_[SKY_COLUMNS];
    float air_phase_[SKY_COLUMNS], aerosol_phase_[SKY_COLUMNS], lit_[SKY_COLUMNS];
    float depth_[3][SKY_COLUMNS], light_[BANDS][SKY_COLUMNS];
};

double row_elevation(size_t row) {
    const double line = double(row) / (SKY_ROWS / 2) - 1.0;
    return 0.5 * double(PI) * line * line;
}

}  // namespace

std::vector<float> single_scattering_sky(const AtmosphereSettings& settings, ThreadPool& pool) {
    constexpr size_t half = SKY_ROWS / 2, row_floats = size_t(SKY_COLUMNS) * 3;
    const Spectra spectra;
    std::vector<float> sky(SKY_ROWS * row_floats);
    pool.parallel_for(half, 4, [&](size_t begin, size_t end, unsigned) {
        SkyRow row(settings, spectra);
        for (size_t y = half + begin; y < half + end; y++) row.compute(row_elevation(y), &sky[y * row_floats]);
    });
    // The ground shows the horizon, faded out: black from 0.4 below.
    for (size_t y = 0; y < half; y++) {
        const float clear = max_f(1.0f - 2.5f * float(std::sin(row_elevation(y))), 0.0f);
        const float fade = clear * clear * clear;
        for (size_t k = 0; k < row_floats; k++) sky[y * row_floats + k] = sky[half * row_floats + k] * fade;
    }
    return sky;
}

Vec3 single_scattering_sun(const AtmosphereSettings& settings) {
    const Spectra spectra;
    const double r = EARTH_RADIUS + std::clamp(settings.altitude, 1.0, HIGHEST);
    const Depth depth = depth_to_sun(r, std::sin(settings.sun_elevation));
    Vec3 xyz = make_vec3(0.0f);
    for (int b = 0; b < BANDS; b++) {
        const float through = std::exp(-spectra.air[b] * depth.air * float(settings.air) -
                                       AEROSOL_EXTINCTION * depth.aerosol * float(settings.aerosol));
        xyz += make_vec3(spectra.xyz[b][0], spectra.xyz[b][1], spectra.xyz[b][2]) * through;
    }
    return xyz;
}

}  // namespace luch::cpu

// The atmosphere with multiple scattering, at 630, 560, 490 and 430 nm. Lengths in kilometres.
// Sources: Garcia Linan, "Physically based sky", 2023 (the model, its spectral quantities, the fit of
// later bounces); Hillaire, "Physically Based Sky, Atmosphere and Cloud Rendering in Frostbite", 2016
// (the integral over a step).
#include <algorithm>
#include <cmath>

#include "cpu/sky/atmosphere.h"
#include "luch/math/bounds.h"
#include "luch/math/fn.h"

namespace luch::cpu {
namespace {

constexpr int BANDS = 4, STEPS = 64;
constexpr double EARTH_RADIUS = 6371.0, THICKNESS = 100.0;
constexpr int LUT_ALTITUDES = 64, LUT_COSINES = 256;
constexpr float AEROSOL_G = 0.8f, GROUND_ALBEDO = 0.3f;

constexpr float SUN_IRRADIANCE[BANDS] = {1.679f, 1.828f, 1.986f, 1.307f};             // W / m2 / nm
constexpr float AIR_SCATTERING[BANDS] = {6.605e-3f, 1.067e-2f, 1.842e-2f, 3.156e-2f};  // 1 / km at sea level
constexpr float OZONE_CROSS_SECTION[BANDS] = {3.472e-25f, 3.914e-25f, 1.349e-25f, 11.03e-27f};
constexpr float OZONE_DOBSON = 334.5f;
constexpr float AEROSOL_ABSORPTION[BANDS] = {2.8722e-24f, 4.6168e-24f, 7.9706e-24f, 1.3578e-23f};  // urban
constexpr float AEROSOL_SCATTERING[BANDS] = {1.5908e-22f, 1.7711e-22f, 2.0942e-22f, 2.4033e-22f};
constexpr float AEROSOL_DENSITY = 1.3681e20f, AEROSOL_BACKGROUND = 2e6f, AEROSOL_HEIGHT = 0.73f;
constexpr float LATER_BOUNCES[BANDS] = {0.02f * 0.217f, 0.02f * 0.347f, 0.02f * 0.594f, 0.02f};
constexpr float BAND_TO_XYZ[BANDS][3] = {{53.3869177f, 22.9813375f, 0.0f},
                                         {43.9048445f, 71.3477957f, 0.102506868f},
                                         {1.61372783f, 18.4229606f, 31.7429212f},
                                         {20.7626687f, 2.36142135f, 110.480096f}};

// Per band, 1/km.
struct Coefficients {
    float air[BANDS], aerosol[BANDS], extinction[BANDS];
};

Coefficients coefficients_at(double altitude, const AtmosphereSettings& s) {
    const float h = float(std::max(altitude, 0.0));
    const float air = std::exp(-0.07771971f * std::pow(h, 1.16364243f)) * float(s.air);
    const float log_h = std::log(std::max(h, SKY_LOWEST_KM));
    const float off_layer = log_h - 3.22261f;
    const float ozone = 3.78547397e20f * std::exp(-off_layer * off_layer * 5.55555555f - log_h) * float(s.ozone);
    const float background = AEROSOL_BACKGROUND / AEROSOL_DENSITY;
    const float aerosol = AEROSOL_DENSITY * (std::exp(-h / AEROSOL_HEIGHT) + background) * float(s.aerosol);
    Coefficients c;
    for (int b = 0; b < BANDS; b++) {
        c.air[b] = AIR_SCATTERING[b] * air;
        c.aerosol[b] = AEROSOL_SCATTERING[b] * aerosol;
        c.extinction[b] =
            c.air[b] + c.aerosol[b] + AEROSOL_ABSORPTION[b] * aerosol + OZONE_CROSS_SECTION[b] * OZONE_DOBSON * ozone;
    }
    return c;
}

// Along a ray from distance r of the centre; negative where it misses the sphere.
double distance_to_sphere(double r, double cosine, double radius) {
    const double b = r * cosine, c = r * r - radius * radius, d = b * b - c;
    if ((c > 0.0 && b > 0.0) || d < 0.0) return -1.0;
    return c <= 0.0 ? std::sqrt(d) - b : -b - std::sqrt(d);
}

struct Bands {
    float v[BANDS];
};

Bands transmittance(double cosine, double altitude, const AtmosphereSettings& s) {
    const double r = EARTH_RADIUS + altitude;
    const double step = distance_to_sphere(r, cosine, EARTH_RADIUS + THICKNESS) / STEPS;
    float depth[BANDS] = {};
    for (int k = 0; k < STEPS; k++) {
        const double t = (k + 0.5) * step;
        const double h = std::sqrt(r * r + 2.0 * r * cosine * t + t * t) - EARTH_RADIUS;
        const Coefficients c = coefficients_at(h, s);
        for (int b = 0; b < BANDS; b++) depth[b] += c.extinction[b] * float(step);
    }
    Bands through;
    for (int b = 0; b < BANDS; b++) through.v[b] = std::exp(-depth[b]);
    return through;
}

// Transmittance to the sun by altitude and by the cosine of its angle from the zenith.
class TransmittanceTable {
 public:
    TransmittanceTable(const AtmosphereSettings& s, ThreadPool& pool) : values_(LUT_ALTITUDES * LUT_COSINES) {
        pool.parallel_for(LUT_ALTITUDES, 4, [&](size_t begin, size_t end, unsigned) {
            for (size_t row = begin; row < end; row++) {
                for (int k = 0; k < LUT_COSINES; k++) {
                    const double cosine = 2.0 * k / (LUT_COSINES - 1) - 1.0;
                    values_[row * LUT_COSINES + size_t(k)] =
                        transmittance(cosine, THICKNESS * double(row) / (LUT_ALTITUDES - 1), s);
                }
            }
        });
    }

    // All cosines at one altitude (0..1 of the thickness).
    void row_at(float height, Bands (&row)[LUT_COSINES]) const {
        const float y = saturate_f(height) * (LUT_ALTITUDES - 1);
        const int low = int(y), high = std::min(low + 1, LUT_ALTITUDES - 1);
        const float t = y - float(low);
        for (int k = 0; k < LUT_COSINES; k++) {
            const Bands &a = values_[size_t(low * LUT_COSINES + k)], &b = values_[size_t(high * LUT_COSINES + k)];
            for (int band = 0; band < BANDS; band++) row[k].v[band] = mix_f(a.v[band], b.v[band], t);
        }
    }
    const Bands* ground() const { return values_.data(); }

 private:
    std::vector<Bands> values_;
};

// What one step along a row's rays shares: everything that depends on the altitude alone.
struct Step {
    Coefficients c;
    Bands row[LUT_COSINES];  // transmittance to the sun from here
    float weight[BANDS];     // of the light that this step scatters: transmittance so far x integral
    float from_ground[BANDS];
    double r, t;  // distance from the centre, along the ray
};

class SkyRow {
 public:
    SkyRow(const AtmosphereSettings& s, const TransmittanceTable& table) : settings_(s), table_(table) {
        sun_z_ = std::sin(s.sun_elevation);
        sun_x_ = -std::sqrt(std::max(1.0 - sun_z_ * sun_z_, 0.0));
        observer_ = EARTH_RADIUS + std::clamp(s.altitude, 1.0, 99999.0) / 1000.0;
    }

    // out: SKY_COLUMNS x 3.
    void compute(double elevation, float* out) {
        start(elevation);
        const double up = std::sin(elevation);
        const double ground = distance_to_sphere(observer_, up, EARTH_RADIUS);
        const double end = ground < 0.0 ? distance_to_sphere(observer_, up, EARTH_RADIUS + THICKNESS) : ground;
        const double length = end / STEPS;
        float through[BANDS] = {1.0f, 1.0f, 1.0f, 1.0f};
        for (int k = 0; k < STEPS; k++) {
            prepare((k + 0.5) * length, up, float(length), through);
            for (int column = 0; column < SKY_COLUMNS; column++) scatter(column);
        }
        for (int column = 0; column < SKY_COLUMNS; column++) {
            for (int c = 0; c < 3; c++) {
                float sum = 0.0f;
                for (int b = 0; b < BANDS; b++) sum += light_[column].v[b] * BAND_TO_XYZ[b][c];
                out[3 * column + c] = sum;
            }
        }
    }

 private:
    void start(double elevation) {
        for (int column = 0; column < SKY_COLUMNS; column++) {
            const double azimuth = double(PI) * (column + 0.5) / SKY_COLUMNS;
            const double to_sun = std::cos(elevation) * std::cos(azimuth) * sun_x_ + std::sin(elevation) * sun_z_;
            const float along = float(-to_sun);  // the models' phase functions take the light's own direction
            const float width = 1.0f + AEROSOL_G * AEROSOL_G + 2.0f * AEROSOL_G * along;
            light_[column] = {};
            to_sun_[column] = to_sun;
            air_phase_[column] = 3.0f / (16.0f * PI) * (1.0f + along * along);
            aerosol_phase_[column] = (1.0f - AEROSOL_G * AEROSOL_G) / (4.0f * PI * width * std::sqrt(width));
        }
    }

    void prepare(double t, double up, float length, float (&through)[BANDS]) {
        step_.t = t;
        step_.r = std::sqrt(observer_ * observer_ + 2.0 * observer_ * up * t + t * t);
        const double altitude = std::max(step_.r - EARTH_RADIUS, 0.0);
        step_.c = coefficients_at(altitude, settings_);
        table_.row_at(float(altitude / THICKNESS), step_.row);
        const double ratio = EARTH_RADIUS / step_.r;
        const float solid_angle = TWO_PI * float(1.0 - std::sqrt(std::max(1.0 - ratio * ratio, 0.0)));
        const Bands &zenith_below = table_.ground()[LUT_COSINES - 1], &zenith_here = step_.row[LUT_COSINES - 1];
        for (int b = 0; b < BANDS; b++) {
            const float kept = std::exp(-length * step_.c.extinction[b]);
            const float integral = (1.0f - kept) / std::max(step_.c.extinction[b], SKY_THINNEST);
            step_.weight[b] = through[b] * integral * SUN_IRRADIANCE[b];
            step_.from_ground[b] =
                solid_angle * (GROUND_ALBEDO * INV_PI * INV_PI * 0.25f) * zenith_below.v[b] / zenith_here.v[b];
            through[b] *= kept;
        }
    }

    void scatter(int column) {
        const float cosine = float((observer_ * sun_z_ + to_sun_[column] * step_.t) / step_.r);
        const float x = saturate_f(cosine * 0.5f + 0.5f) * (LUT_COSINES - 1);
        const int low = int(x), high = low + 1 < LUT_COSINES ? low + 1 : low;
        const float t = x - float(low);
        const Bands *here = step_.row, *ground = table_.ground();
        const float fit = 1.0f / (1.0f + 5.0f * exp_f(-17.92f * cosine));
        for (int b = 0; b < BANDS; b++) {
            const float to_sun = mix_f(here[low].v[b], here[high].v[b], t);
            const float to_ground = mix_f(ground[low].v[b], ground[high].v[b], t);
            const float later = LATER_BOUNCES[b] * fit + step_.from_ground[b] * to_ground * cosine;
            light_[column].v[b] += step_.weight[b] * (step_.c.air[b] * (air_phase_[column] * to_sun + later) +
                                                      step_.c.aerosol[b] * (aerosol_phase_[column] * to_sun + later));
        }
    }

    const AtmosphereSettings& settings_;
    const TransmittanceTable& table_;
    double sun_x_, sun_z_, observer_;
    Step step_;
    Bands light_[SKY_COLUMNS];
    double to_sun_[SKY_COLUMNS];
    float air_phase_[SKY_COLUMNS], aerosol_phase_[SKY_COLUMNS];
};

}  // namespace

std::vector<float> multiple_scattering_sky(const AtmosphereSettings& settings, ThreadPool& pool) {
    const TransmittanceTable table(settings, pool);
    std::vector<float> sky(size_t(SKY_ROWS) * SKY_COLUMNS * 3);
    pool.parallel_for(SKY_ROWS, 4, [&](size_t begin, size_t end, unsigned) {
        SkyRow row(settings, table);
        for (size_t y = begin; y < end; y++) {
            const double line = 2.0 * (double(y) + 0.5) / SKY_ROWS - 1.0;
            row.compute(std::copysign(line * line, line) * 0.5 * double(PI), &sky[y * SKY_COLUMNS * 3]);
        }
    });
    return sky;
}

Vec3 multiple_scattering_sun(const AtmosphereSettings& settings) {
    const double altitude = std::clamp(settings.altitude, 1.0, 99999.0) / 1000.0;
    const Bands through = transmittance(std::sin(settings.sun_elevation), altitude, settings);
    Vec3 xyz = make_vec3(0.0f);
    for (int b = 0; b < BANDS; b++) {
        const float light = SUN_IRRADIANCE[b] * through.v[b];
        xyz += make_vec3(BAND_TO_XYZ[b][0], BAND_TO_XYZ[b][1], BAND_TO_XYZ[b][2]) * light;
    }
    return xyz;
}

}  // namespace luch::cpu

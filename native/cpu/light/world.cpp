// The world's importance map.
#include <cmath>

#include "cpu/light/build.h"
#include "cpu/light/cdf.h"
#include "luch/light/world.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

float usable_luminance(Color c) {
    float l = luminance(abs_v(c));
    return finite_f(l) ? l : 0.0f;  // a broken texel must not own the map
}

// Fills density with luminance times cosine of what rises above the mean: rays that leave by the BSDF find the even
// part well enough by themselves, and samples spent on it are lost to the rest (MIS compensation, Karlik et al. 2019).
// Returns the mean luminance over the sphere.
double fill_density(const WorldInput& in, size_t width, size_t height, std::vector<float>* density) {
    density->resize(width * height);
    double sum = 0.0, weight = 0.0;
    std::vector<double> cosines(height);
    for (size_t y = 0; y < height; ++y) {
        cosines[y] = std::cos(3.14159265358979 * ((static_cast<double>(y) + 0.5) / static_cast<double>(height) - 0.5));
        for (size_t x = 0; x < width; ++x) {
            const float* c = in.map_rgb + 3 * (y * width + x);
            float l = usable_luminance({c[0], c[1], c[2]});
            (*density)[y * width + x] = l;
            sum += l * cosines[y];
            weight += cosines[y];
        }
    }
    double mean = sum / weight;
    for (size_t i = 0; i < density->size(); ++i) {
        double rise = std::fmax((*density)[i] - mean, 0.0) * cosines[i / width];
        (*density)[i] = static_cast<float>(rise);
    }
    return mean;
}

// Returns the integral of the density before it is normalised.
double build_map(const WorldInput& in, double* mean, WorldArrays* a) {
    const size_t width = static_cast<size_t>(in.map_width), height = static_cast<size_t>(in.map_height);
    *mean = fill_density(in, width, height, &a->density);
    std::vector<double> rows(height + 1), columns(width);
    a->row_cdf.resize(height + 2);
    a->column_cdf.resize((height + 1) * (width + 1));
    double integral = 0.0;  // of density over the unit square
    for (size_t row = 0; row <= height; ++row) {
        const float* below = &a->density[(row == 0 ? 0 : row - 1) * width];
        const float* above = &a->density[(row == height ? row - 1 : row) * width];
        double share = (row == 0 || row == height) ? 0.5 : 1.0;
        rows[row] = 0.0;
        for (size_t x = 0; x < width; ++x) {
            size_t right = x + 1 == width ? 0 : x + 1;
            columns[x] = 0.25 * (static_cast<double>(below[x]) + below[right] + above[x] + above[right]);
            rows[row] += columns[x] * share;
        }
        fill_cdf(columns, &a->column_cdf[row * (width + 1)]);
        integral += rows[row];
    }
    fill_cdf(rows, a->row_cdf.data());
    integral /= static_cast<double>(width) * static_cast<double>(height);
    double scale = integral > 0.0 ? 1.0 / integral : 0.0;
    for (float& d : a->density) d = static_cast<float>(d * scale);
    return integral;
}

}  // namespace

WorldLight build_world(const WorldInput& in, WorldArrays* arrays) {
    WorldLight w{};
    w.present = in.present;
    w.constant = in.constant || in.map_rgb == nullptr || in.map_width < 1 || in.map_height < 1;
    w.visibility = in.visibility;
    w.lightgroup = in.lightgroup;
    w.max_bounces = in.max_bounces;
    if (!in.present) return w;
    w.radiance = finite_v(in.constant_radiance) ? in.constant_radiance : Color{0.0f, 0.0f, 0.0f};
    double mean = usable_luminance(w.radiance), rise = 0.0;
    if (!w.constant) {
        // Mean over the sphere is integral * pi / 2 (the density holds a cosine whose mean is 2 / pi).
        rise = build_map(in, &mean, arrays) * 3.14159265358979 / 2.0;
        w.width = static_cast<u32>(in.map_width);
        w.height = static_cast<u32>(in.map_height);
        w.density = arrays->density.data();
        w.row_cdf = arrays->row_cdf.data();
        w.column_cdf = arrays->column_cdf.data();
        w.constant = !(rise > EVEN_WORLD_SHARE * mean);  // as good as even
    }
    // Only what the map's samples are for counts against the other lights; an even world hardly does: sampled
    // light from it is worth no more than what rays find there, and each such sample is one less for a lamp.
    double map_irradiance = 3.14159265358979 * (w.constant ? EVEN_WORLD_SHARE * mean : rise);
    double sine = std::sin(0.25 * in.sun_angle), disk = std::sin(0.5 * in.sun_angle);
    double sun_irradiance = in.has_sun ? 3.14159265358979 * disk * disk * usable_luminance(in.sun_radiance) : 0.0;
    w.has_sun = sun_irradiance > 0.0 && in.sun_angle > SMALLEST_WORLD_SUN;
    if (w.has_sun) {
        w.sun_direction = normalize_or(in.sun_direction, {0.0f, 0.0f, 1.0f});
        w.sun_one_minus_cos = static_cast<float>(2.0 * sine * sine);
        w.sun_irradiance = static_cast<float>(std::fmin(sun_irradiance, 1e30));
        w.map_irradiance = static_cast<float>(std::fmin(map_irradiance, 1e30));
    }
    w.irradiance = static_cast<float>(std::fmin(map_irradiance + sun_irradiance, 1e30));
    return w;
}

Vec3 world_map_direction(int width, int height, int x, int y) {
    return equirectangular_direction((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                                     (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
}

}  // namespace luch::cpu

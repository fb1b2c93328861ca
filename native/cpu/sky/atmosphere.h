// Tables of the Sky Texture, computed once per sky: what an observer sees of sunlight scattered in
// Earth's atmosphere, as CIE XYZ. The quantities are Blender's, so that a sky looks as in Cycles.
#pragma once
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/math/vec.h"

namespace luch::cpu {

inline constexpr int SKY_COLUMNS = 256;  // half a turn; the other half mirrors it
inline constexpr int SKY_ROWS = 256;     // nadir to zenith, finer towards the horizon

struct AtmosphereSettings {
    double sun_elevation;  // radians
    double altitude;       // metres
    double air, aerosol, ozone;  // densities relative to Earth's
};

// SKY_ROWS x SKY_COLUMNS x 3 floats. Column 0 is opposite to the sun.
std::vector<float> multiple_scattering_sky(const AtmosphereSettings& settings, ThreadPool& pool);
std::vector<float> single_scattering_sky(const AtmosphereSettings& settings, ThreadPool& pool);

// XYZ irradiance of the sun itself, through the air between it and the observer.
Vec3 multiple_scattering_sun(const AtmosphereSettings& settings);
Vec3 single_scattering_sun(const AtmosphereSettings& settings);

}  // namespace luch::cpu

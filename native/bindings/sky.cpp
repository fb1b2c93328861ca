// Sky tables, for the exporter.
#include "bindings/bind.h"
#include "cpu/sky/atmosphere.h"

namespace luch::bindings {
namespace {

py::array_t<float> sky_radiance(bool multiple, double elevation, double altitude, double air, double aerosol,
                                double ozone) {
    std::vector<float> sky;
    {
        py::gil_scoped_release release;
        cpu::ThreadPool pool;
        const cpu::AtmosphereSettings settings{elevation, altitude, air, aerosol, ozone};
        sky = multiple ? cpu::multiple_scattering_sky(settings, pool) : cpu::single_scattering_sky(settings, pool);
    }
    py::array_t<float> table({cpu::SKY_ROWS, cpu::SKY_COLUMNS, 3});
    std::copy(sky.begin(), sky.end(), table.mutable_data());
    return table;
}

py::tuple sun_irradiance(bool multiple, double elevation, double altitude, double air, double aerosol, double ozone) {
    const cpu::AtmosphereSettings settings{elevation, altitude, air, aerosol, ozone};
    const Vec3 xyz = multiple ? cpu::multiple_scattering_sun(settings) : cpu::single_scattering_sun(settings);
    return py::make_tuple(xyz.x, xyz.y, xyz.z);
}

}  // namespace

void bind_sky(py::module_& m) {
    auto sky = m.def_submodule("sky", "Earth's atmosphere; angles in radians, altitude in metres.");
    sky.def("radiance", &sky_radiance, py::arg("multiple"), py::arg("elevation"), py::arg("altitude"), py::arg("air"),
            py::arg("aerosol"), py::arg("ozone"),
            "XYZ radiance, float32 (256, 256, 3): rows from nadir to zenith, finer towards the horizon; columns over\n"
            "half a turn, from opposite to the sun.");
    sky.def("sun_irradiance", &sun_irradiance, py::arg("multiple"), py::arg("elevation"), py::arg("altitude"),
            py::arg("air"), py::arg("aerosol"), py::arg("ozone"), "XYZ irradiance of a sun at an elevation.");
}

}  // namespace luch::bindings

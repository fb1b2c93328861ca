// Camera rays and the pixel filter over arrays, for tests and tools.
#include "bindings/camera.h"

#include <stdexcept>

#include "bindings/bind.h"
#include "cpu/filter.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

template <typename T>
void read(const py::handle& from, const char* name, T& to) {
    to = from.attr(name).cast<T>();
}

void read_pair(const py::handle& from, const char* name, double (&to)[2]) {
    py::sequence pair = from.attr(name);
    to[0] = pair[0].cast<double>();
    to[1] = pair[1].cast<double>();
}

CameraView view_of(const py::handle& camera, const py::handle& film, const py::sequence& origin) {
    double o[3] = {origin[0].cast<double>(), origin[1].cast<double>(), origin[2].cast<double>()};
    return cpu::make_camera_view(read_camera(camera), read_frame(film), o);
}

// One row per ray: origin, direction, t_min, t_max, footprint, spread.
Floats camera_rays(const py::handle& camera, const py::handle& film, const Floats& raster, const Floats& lens,
                   const py::sequence& origin) {
    if (raster.ndim() != 2 || raster.shape(1) != 2 || lens.ndim() != 2 || lens.shape(1) != 2 ||
        lens.shape(0) != raster.shape(0))
        throw py::value_error("raster and lens must both have shape (N, 2)");
    CameraView view = view_of(camera, film, origin);
    Floats out({raster.shape(0), py::ssize_t{10}});
    for (py::ssize_t i = 0; i < raster.shape(0); ++i) {
        const float *r = raster.data(i, 0), *u = lens.data(i, 0);
        CameraRay c = generate_ray(view, {r[0], r[1]}, {u[0], u[1]});
        float row[10] = {c.ray.origin.x,    c.ray.origin.y, c.ray.origin.z, c.ray.direction.x, c.ray.direction.y,
                         c.ray.direction.z, c.ray.t_min,    c.ray.t_max,    c.footprint,       c.spread};
        std::copy(row, row + 10, out.mutable_data(i, 0));
    }
    return out;
}

// One row per point: raster x, raster y, depth, distance.
Floats camera_project(const py::handle& camera, const py::handle& film, const Floats& points,
                      const py::sequence& origin) {
    if (points.ndim() != 2 || points.shape(1) != 3) throw py::value_error("points must have shape (N, 3)");
    CameraView view = view_of(camera, film, origin);
    Floats out({points.shape(0), py::ssize_t{4}});
    for (py::ssize_t i = 0; i < points.shape(0); ++i) {
        const float* p = points.data(i, 0);
        Vec3 world = {p[0], p[1], p[2]};
        Vec2 raster = world_to_raster(view, world);
        float row[4] = {raster.x, raster.y, camera_depth(view, world), camera_distance(view, world)};
        std::copy(row, row + 4, out.mutable_data(i, 0));
    }
    return out;
}

}  // namespace

cpu::CameraSpec read_camera(const py::handle& camera) {
    cpu::CameraSpec spec;
    read(camera, "kind", spec.kind);
    auto matrix = camera.attr("matrix").cast<py::array_t<double, py::array::c_style | py::array::forcecast>>();
    if (matrix.size() != 12) throw std::invalid_argument("Camera: its matrix must be (3, 4).");
    std::copy(matrix.data(), matrix.data() + 12, spec.matrix);
    read(camera, "lens_mm", spec.lens_mm);
    read(camera, "sensor_width_mm", spec.sensor_width_mm);
    read(camera, "sensor_height_mm", spec.sensor_height_mm);
    read(camera, "sensor_fit", spec.sensor_fit);
    read(camera, "ortho_scale", spec.ortho_scale);
    read(camera, "shift_x", spec.shift_x);
    read(camera, "shift_y", spec.shift_y);
    read(camera, "clip_start", spec.clip_start);
    read(camera, "clip_end", spec.clip_end);
    read(camera, "use_dof", spec.use_dof);
    read(camera, "focus_distance", spec.focus_distance);
    read(camera, "fstop", spec.fstop);
    read(camera, "blades", spec.blades);
    read(camera, "blades_rotation", spec.blades_rotation);
    read(camera, "aperture_ratio", spec.aperture_ratio);
    read_pair(camera, "latitude", spec.latitude);
    read_pair(camera, "longitude", spec.longitude);
    read(camera, "fisheye_fov", spec.fisheye_fov);
    read(camera, "fisheye_lens_mm", spec.fisheye_lens_mm);
    py::sequence polynomial = camera.attr("fisheye_polynomial");
    if (polynomial.size() != 5) throw py::value_error("Camera: fisheye_polynomial must have 5 coefficients");
    for (size_t k = 0; k < 5; ++k) spec.fisheye_polynomial[k] = polynomial[k].cast<double>();
    read_pair(camera, "cylinder_angle", spec.cylinder_angle);
    read_pair(camera, "cylinder_height", spec.cylinder_height);
    return spec;
}

cpu::FrameSpec read_frame(const py::handle& film) {
    cpu::FrameSpec spec;
    read(film, "width", spec.width);
    read(film, "height", spec.height);
    read_pair(film, "pixel_aspect", spec.pixel_aspect);
    return spec;
}

void bind_camera(py::module_& m) {
    auto camera = m.def_submodule("camera", "Camera rays and pixel filters.");
    camera.def("rays", &camera_rays, py::arg("camera"), py::arg("film"), py::arg("raster"), py::arg("lens"),
               py::arg("origin") = py::make_tuple(0.0, 0.0, 0.0),
               "float32 (N, 10): origin, direction, t_min, t_max, footprint, spread of the ray through each "
               "raster position (N, 2) in pixels and lens position (N, 2) in [0, 1).");
    camera.def("project", &camera_project, py::arg("camera"), py::arg("film"), py::arg("points"),
               py::arg("origin") = py::make_tuple(0.0, 0.0, 0.0),
               "float32 (N, 4): raster x, y, depth and distance of world points (N, 3).");
    camera.def(
        "filter_offsets",
        [](const std::string& kind, double width, const Floats& u) {
            PixelFilter filter = cpu::make_pixel_filter(kind, width);
            Floats out(u.size());
            for (py::ssize_t i = 0; i < u.size(); ++i) out.mutable_data()[i] = sample_filter(filter, u.data()[i]);
            return out;
        },
        "Offsets from a pixel's centre, in pixels, for numbers in [0, 1).");
}

}  // namespace luch::bindings

// One file per subject binds itself through one of these; module.cpp calls them all.
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace luch::bindings {
namespace py = pybind11;

void bind_bsdf(py::module_& m);
void bind_camera(py::module_& m);
void bind_film(py::module_& m);
void bind_accel(py::module_& m);
void bind_kd_short_stack(py::module_& m);
void bind_light(py::module_& m);
void bind_math(py::module_& m);
void bind_media(py::module_& m);
void bind_motion(py::module_& m);
void bind_photons(py::module_& m);
void bind_render(py::module_& m);
void bind_sampling(py::module_& m);
void bind_scene_trees(py::module_& m);
void bind_shade(py::module_& m);
void bind_sky(py::module_& m);
void bind_structure(py::module_& m);
void bind_textures(py::module_& m);
void bind_triangle_tests(py::module_& m);

}  // namespace luch::bindings

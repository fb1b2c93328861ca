// The renderer as Python sees it: one scene, rendered in steps, readable at any time between them.
#include "bindings/bind.h"
#include "bindings/film.h"
#include "bindings/scene_reader.h"

namespace luch::bindings {
namespace {

class PyRenderer {
 public:
    explicit PyRenderer(const py::object& scene) {
        ReadScene read = read_scene(scene);
        dropped_instances_ = read.dropped_instances;
        renderer_ = std::make_unique<cpu::Renderer>(std::move(read.store), read.input);
    }

    bool render(u32 first, u32 count) {
        py::gil_scoped_release release;
        return renderer_->render(first, count);
    }

    bool prepare() {
        py::gil_scoped_release release;
        return renderer_->prepare();
    }

    void cancel() { renderer_->cancel(); }
    double step_progress() const { return renderer_->step_progress(); }

    py::dict passes() const { return resolve_film(renderer_->film()); }

    py::tuple deviations() const { return film_deviations(renderer_->film()); }

    py::dict stats() const {
        cpu::RenderStats s = renderer_->stats();
        py::dict d;
        d["paths"] = s.counts.paths;
        d["rays"] = s.counts.rays;
        d["shadow_rays"] = s.counts.shadow_rays;
        d["surface_points"] = s.counts.surface_points;
        d["non_finite_samples"] = s.counts.bad_samples;
        d["accelerator"] = s.accel_name;
        d["accelerator_reason"] = s.accel_reason;
        d["triangles"] = s.accel.triangles;
        d["spheres"] = s.accel.spheres;
        d["structure_nodes"] = s.accel.nodes;
        d["structure_bytes"] = s.accel.bytes;
        d["dropped_triangles"] = s.accel.dropped_triangles;
        d["dropped_spheres"] = s.accel.dropped_spheres;
        d["dropped_instances"] = dropped_instances_;
        d["structure_seconds"] = s.accel_seconds;
        d["lights_seconds"] = s.lights_seconds;
        d["trace_seconds"] = s.trace_seconds;
        d["scene_bytes"] = s.scene_bytes;
        d["film_pixel_bytes"] = s.film_pixel_bytes;
        d["lens_samples"] = s.counts.lens_samples;
        d["lamp_searches"] = s.counts.lamp_searches;
        d["transparent_steps"] = s.counts.transparent_steps;
        d["world_points"] = s.counts.world_points;
        d["light_points"] = s.counts.light_points;
        return d;
    }

 private:
    std::unique_ptr<cpu::Renderer> renderer_;
    u64 dropped_instances_ = 0;
};

}  // namespace

void bind_render(py::module_& m) {
    auto render = m.def_submodule("render", "Rendering of a luch.scene.Scene on the CPU.");
    py::class_<PyRenderer>(render, "Renderer")
        .def(py::init<const py::object&>(), py::arg("scene"),
             "Reads the scene. Raises ValueError, naming the object, for data that does not fit together.")
        .def("prepare", &PyRenderer::prepare, "Builds structures and lights, once, first of all. False when cancelled.")
        .def("render", &PyRenderer::render, py::arg("first"), py::arg("count"),
             "Traces samples [first, first + count) of every pixel. False when cancelled.")
        .def("cancel", &PyRenderer::cancel, "Callable from any thread.")
        .def("step_progress", &PyRenderer::step_progress, "Share of the running step that is done, 0..1.")
        .def("passes", &PyRenderer::passes, "Blender's pass name -> float32 (H, W, C), bottom row first.")
        .def("deviations", &PyRenderer::deviations,
             "(mean, deviation), float32 (H, W, 3): Combined, and one draw of its error. Asks for Film.halves.")
        .def("stats", &PyRenderer::stats, "Counts, bytes and seconds.");
}

}  // namespace luch::bindings

// The renderer as Python sees it: one scene, rendered in steps, readable at any time between them.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <optional>

#include <pybind11/stl.h>

#include "bindings/bind.h"
#include "bindings/device_image.h"
#include "bindings/film.h"
#include "bindings/forced.h"
#include "bindings/scene_reader.h"
#include "bindings/scene_trees.h"
#include "luch/integrator/borders.h"
#include "luch/integrator/subsurface.h"

namespace luch::bindings {
namespace {

// As Refusal has them; luch/cuda/render.py reads the device's under the same names.
constexpr const char* REFUSAL_NAMES[REFUSALS] = {"refused_emission", "refused_direct", "refused_scatter",
                                                 "refused_flight", "refused_data"};

template <class T>
using Row = py::array_t<T, py::array::c_style | py::array::forcecast>;

class PyRenderer {
 public:
    PyRenderer(const py::object& scene, bool for_device, std::optional<u64> device_builds_from) {
        ReadScene read = read_scene(scene);
        read.input.for_device = for_device;
        if (device_builds_from) read.input.device_builds_from = *device_builds_from;
        dropped_instances_ = read.dropped_instances;
        image_warnings_ = read.warnings;
        renderer_ = std::make_unique<cpu::Renderer>(std::move(read.store), read.input);
    }

    bool render(u32 first, u32 count) {
        py::gil_scoped_release release;
        return renderer_->render(first, count);
    }

    bool render_regions(const std::vector<u32>& begins, const std::vector<u32>& ends) {
        py::gil_scoped_release release;
        return renderer_->render_regions(begins, ends);
    }

    bool prepare() {
        py::gil_scoped_release release;
        return renderer_->prepare();
    }

    bool set_view(const py::object& scene) {
        cpu::ViewInput view = read_view(scene);
        py::gil_scoped_release release;
        renderer_->set_view(view);
        return true;
    }

    void take_structures(const PyRenderer& other) { renderer_->take_structures(*other.renderer_); }

    double origin_reach() const {
        py::gil_scoped_release release;
        return renderer_->origin_reach();
    }

    // float32 (N, 8), as luch::Ray.
    py::array_t<float> probe_rays() const {
        std::vector<CameraRay> rays = renderer_->probe_rays();
        py::array_t<float> out({py::ssize_t(rays.size()), py::ssize_t(sizeof(Ray) / sizeof(float))});
        for (size_t i = 0; i < rays.size(); i++)
            std::memcpy(out.mutable_data(py::ssize_t(i), 0), &rays[i].ray, sizeof(Ray));
        return out;
    }

    double origin_reach_of(const Row<float>& distances, const Row<u32>& instances) const {
        std::vector<CameraRay> rays = renderer_->probe_rays();
        if (size_t(distances.size()) != rays.size() || size_t(instances.size()) != rays.size())
            throw py::value_error("one distance and one instance for each ray of probe_rays()");
        return renderer_->origin_reach(rays, distances.data(), instances.data());
    }

    void cancel() { renderer_->cancel(); }
    double step_progress() const { return renderer_->step_progress(); }

    py::dict passes() const { return resolve_film(renderer_->film()); }

    // (blocks, links) as bindings/device_image.h has them, of the RenderTask and of the structure; and the groups whose
    // trees the device builds (bindings/scene_trees.h), with the depth of the rest.
    static py::tuple device_images(const py::object& self) {
        cpu::Renderer& renderer = *self.cast<PyRenderer&>().renderer_;
        cpu::DeviceImage trees;
        renderer.trees().append(trees);
        return py::make_tuple(bindings::device_image(renderer.device_image(), self),
                              bindings::device_image(trees, self), left_groups(renderer.trees(), self),
                              renderer.trees().stats().depth);
    }

    // The first of them alone: after set_view().
    static py::tuple device_view(const py::object& self) {
        return bindings::device_image(self.cast<PyRenderer&>().renderer_->device_image(), self);
    }

    // [(name, channels, PassRead)]: what a device needs to read passes itself.
    py::list pass_reads() const {
        py::list reads;
        for (const cpu::Pass& pass : renderer_->film().passes()) {
            const PassRead read{pass.from, renderer_->film().exposure()};
            char bytes[sizeof(PassRead)] = {};
            std::memcpy(bytes, &read, sizeof(read));
            reads.append(py::make_tuple(pass.name, pass.from.channels, py::bytes(bytes, sizeof(bytes))));
        }
        return reads;
    }

    // The film's sums (pixels, channels) float64 and sample counts (pixels,) uint32, to be written by whoever renders
    // in this renderer's place.
    static py::tuple film_arrays(const py::object& self) {
        // They outlive the renderer and its next view: the film is shared with whoever holds them.
        auto film = std::make_unique<std::shared_ptr<cpu::Film>>(self.cast<PyRenderer&>().renderer_->shared_film());
        cpu::Film& arrays = **film;
        py::capsule owner(film.release(), [](void* held) { delete static_cast<std::shared_ptr<cpu::Film>*>(held); });
        return bindings::film_arrays(arrays, owner);
    }

    // What decides which code a device needs.
    py::dict device_facts() const {
        const RenderView& scene = renderer_->scene();
        bool transparent = false;
        u32 registers = 0;
        py::list programs;
        auto add = [&](const Program& p) {
            transparent = transparent || (p.flags & PROGRAM_TRANSPARENT);
            registers = std::max(registers, p.register_count);
            programs.append(py::make_tuple(p.first_instruction, p.instruction_count, p.light_instruction_count,
                                           p.register_count, p.first_constant, p.constant_count));
        };
        for (u32 m = 0; m < scene.view.material_count; ++m) add(scene.view.materials[m].program);
        add(scene.view.world_program);
        for (u32 l = 0; l < scene.view.lights->lamp_count; ++l)
            if (scene.view.lights->lamps[l].has_program) add(scene.view.lights->lamps[l].program);
        py::dict facts;
        facts["programs"] = programs;
        facts["most_rounds"] = most_rounds(scene.limits);
        facts["registers"] = registers;
        facts["transparent"] = transparent;
        facts["subsurface"] = scene.has_subsurface;
        facts["media"] = scene.has_media;
        facts["materials"] = scene.view.material_count;
        facts["curves"] = renderer_->trees().stats().pieces > 0;
        facts["structure"] = cpu::accel_name({false, renderer_->trees().kind()});
        bool emission_programs = false, lamp_programs = false;
        for (u32 m = 0; m < scene.view.material_count; ++m)
            emission_programs = emission_programs || !scene.material_emission[m].constant;
        for (u32 l = 0; l < scene.view.lights->lamp_count; ++l)
            lamp_programs = lamp_programs || scene.view.lights->lamps[l].has_program;
        facts["emission_programs"] = emission_programs;
        facts["lamp_programs"] = lamp_programs;
        facts["visible_lamps"] = scene.has_visible_lamps;
        facts["world_program"] = scene.has_world && !scene.world_emission.constant;
        facts["world_reads_camera"] = renderer_->world_reads_camera();
        facts["world_apart"] = renderer_->trees().has_world_apart();
        facts["moves"] = scene.shutter != nullptr;
        facts["trees_move"] = renderer_->trees().moves();
        facts["photon_maps"] = scene.photon_maps;
        facts["casters_reach"] = scene.casters.reach;
        return facts;
    }

    py::tuple deviations() const { return film_deviations(renderer_->film()); }

    py::dict stats() const {
        cpu::RenderStats s = renderer_->stats();
        py::dict d;
        d["paths"] = s.counts.paths;
        d["rays"] = s.counts.rays;
        d["shadow_rays"] = s.counts.shadow_rays;
        d["surface_points"] = s.counts.surface_points;
        u64 refused = 0;
        for (u32 cause = 0; cause < REFUSALS; cause++) {
            d[REFUSAL_NAMES[cause]] = s.counts.refused[cause];
            refused += s.counts.refused[cause];
        }
        d["non_finite_samples"] = refused;
        d["clamped_units"] = s.counts.clamped;
        d["cut_units"] = s.counts.cut;
        d["accelerator"] = s.accel_name;
        d["accelerator_reason"] = s.accel_reason;
        d["triangles"] = s.accel.triangles;
        d["spheres"] = s.accel.spheres;
        d["curve_pieces"] = s.accel.pieces;
        d["structure_nodes"] = s.accel.nodes;
        d["structure_bytes"] = s.accel.bytes;
        d["dropped_triangles"] = s.accel.dropped_triangles;
        d["duplicate_primitives"] = s.accel.duplicates;
        py::list left_out;
        for (const cpu::LeftOut& row : s.accel.left_out)
            left_out.append(py::make_tuple(row.mesh, row.invalid, row.too_far, row.empty, row.copies));
        d["left_out"] = left_out;
        d["dropped_spheres"] = s.accel.dropped_spheres;
        d["dropped_curve_pieces"] = s.accel.dropped_pieces;
        d["dropped_instances"] = dropped_instances_.size();
        d["dropped_objects"] = dropped_instances_;
        d["image_warnings"] = image_warnings_;
        d["structure_builds"] = s.accel_builds;
        d["structure_seconds"] = s.accel_seconds;
        d["lights_seconds"] = s.lights_seconds;
        d["trace_seconds"] = s.trace_seconds;
        d["scene_bytes"] = s.scene_bytes;
        d["film_pixel_bytes"] = s.film_pixel_bytes;
        d["lens_samples"] = s.counts.lens_samples;
        d["time_samples"] = s.counts.time_samples;
        d["lamp_searches"] = s.counts.lamp_searches;
        d["transparent_steps"] = s.counts.transparent_steps;
        d["world_points"] = s.counts.world_points;
        d["light_points"] = s.counts.light_points;
        d["subsurface_walks"] = s.counts.subsurface_walks;
        d["subsurface_steps"] = s.counts.subsurface_steps;
        d["subsurface_tree_bytes"] = s.local_tree_bytes;
        d["flights"] = s.counts.flights;
        d["photons"] = s.counts.photons;
        d["photons_landed"] = s.counts.photons_landed;
        d["photon_maps"] = s.photon_maps;
        d["photon_radius_m"] = s.photon_radius;
        d["photon_map_bytes"] = s.photon_map_bytes;
        d["photon_seconds"] = s.photon_seconds;
        return d;
    }

 private:
    std::unique_ptr<cpu::Renderer> renderer_;
    std::vector<u32> dropped_instances_;
    std::vector<std::string> image_warnings_;
};

// Where luch/cuda/render.py finds the fields that it sets in a RenderTask, by name; and the sizes of what it allocates.
py::dict task_fields() {
    py::dict fields;
#define LUCH_FIELD(name) fields[#name] = offsetof(RenderTask, name)
    LUCH_FIELD(film.rows);
    LUCH_FIELD(film.sample_counts);
    LUCH_FIELD(wave.slots);
    LUCH_FIELD(wave.layer_pixels);
    LUCH_FIELD(wave.layer_stride);
    LUCH_FIELD(wave.film_pixels);
    LUCH_FIELD(wave.paths);
    LUCH_FIELD(wave.rays);
    LUCH_FIELD(wave.ray_slot);
    LUCH_FIELD(wave.ray_kind);
    LUCH_FIELD(wave.next_rays);
    LUCH_FIELD(wave.next_slot);
    LUCH_FIELD(wave.next_kind);
    LUCH_FIELD(wave.hits);
    LUCH_FIELD(wave.sorted);
    LUCH_FIELD(wave.material_first);
    LUCH_FIELD(wave.shadow_rays);
    LUCH_FIELD(wave.shadows);
    LUCH_FIELD(wave.shadow_kind);
    LUCH_FIELD(wave.blocked);
    LUCH_FIELD(wave.see_through);
    LUCH_FIELD(wave.walks);
    LUCH_FIELD(wave.aovs);
    LUCH_FIELD(wave.media);
    LUCH_FIELD(wave.shadow_media);
    LUCH_FIELD(wave.counters);
    LUCH_FIELD(wave.totals);
    LUCH_FIELD(wave.ray_time);
    LUCH_FIELD(wave.next_time);
    LUCH_FIELD(wave.shadow_time);
    LUCH_FIELD(wave.ticks);
    LUCH_FIELD(wave.ray_ticks);
    LUCH_FIELD(wave.shadow_ticks);
    LUCH_FIELD(wave.landed);
    LUCH_FIELD(wave.landed_count);
    LUCH_FIELD(wave.landed_room);
    LUCH_FIELD(scene.photons);
    LUCH_FIELD(film.layout.stride);
    LUCH_FIELD(film.layout.marks);
    LUCH_FIELD(film.layout.time);
    LUCH_FIELD(film.layout.aov_count);
    LUCH_FIELD(film.layout.ambient_occlusion);
#undef LUCH_FIELD
    return fields;
}

py::dict task_sizes() {
    py::dict sizes;
    sizes["path"] = PATH_WORDS * sizeof(PathWord);
    sizes["ray"] = sizeof(Ray);
    sizes["hit"] = sizeof(Hit);
    sizes["shadow"] = sizeof(ShadowRay);
    sizes["walk"] = sizeof(SubsurfaceWalk);
    sizes["media"] = sizeof(MediumStack);
    sizes["photon"] = sizeof(Photon);
    sizes["photon_place"] = sizeof(PhotonPlace);
    sizes["counters"] = u32(WAVE_COUNTERS);
    sizes["totals"] = u32(TOTALS);
    sizes["clocks"] = u32(WAVE_CLOCKS);
    return sizes;
}

// Where luch/cuda/upload.py finds what it needs of luch::ImageView.
py::dict image_layout() {
    return py::dict(py::arg("size") = sizeof(ImageView), py::arg("pixels") = offsetof(ImageView, pixels),
                    py::arg("width") = offsetof(ImageView, width), py::arg("height") = offsetof(ImageView, height),
                    py::arg("tiles_across") = offsetof(ImageView, tiles_across), py::arg("tile") = IMAGE_TILE);
}

}  // namespace

void bind_render(py::module_& m) {
    auto render = m.def_submodule("render", "Rendering of a luch.scene.Scene on the CPU.");
    render.def("task_fields", &task_fields);
    render.def("task_sizes", &task_sizes);
    render.def("forcible_effects", &forcible_effects);
    render.def("image_layout", &image_layout);
    py::class_<PyRenderer>(render, "Renderer")
        .def(py::init<const py::object&, bool, std::optional<u64>>(), py::arg("scene"), py::arg("for_device") = false,
             py::arg("device_builds_from") = py::none(),
             "Reads the scene. Raises ValueError, naming the object, for data that does not fit together.")
        .def("prepare", &PyRenderer::prepare, "Builds structures and lights, once, first of all. False when cancelled.")
        .def(
            "set_view", &PyRenderer::set_view, py::arg("scene"),
            "After prepare(): the same scene with another camera, film (of the same light groups and AOVs), limits and "
            "samples. Nothing is built anew; the film's sums begin anew, and an earlier cancel is forgotten. True, as "
            "nothing stands against it. Raises ValueError as the constructor, and for another Scene.origin.")
        .def(
            "origin_reach", &PyRenderer::origin_reach,
            "How far from Scene.origin the camera's place may lie for a picture as right as one with the origin there: "
            "metres, of what a few rays of the present view meet.")
        .def("take_structures", &PyRenderer::take_structures, py::arg("other"),
             "Before prepare(): the structures of a renderer of the same geometry, origin and settings are to serve.")
        .def("probe_rays", &PyRenderer::probe_rays, "Those rays, float32 (N, 8), for another device to trace.")
        .def("origin_reach_of", &PyRenderer::origin_reach_of, py::arg("distances"), py::arg("instances"),
             "As origin_reach(), of what they met: distances float32 (N,), inf: nothing; instances uint32 (N,).")
        .def("render", &PyRenderer::render, py::arg("first"), py::arg("count"),
             "Traces samples [first, first + count) of every pixel. False when cancelled.")
        .def("render_regions", &PyRenderer::render_regions, py::arg("begins"), py::arg("ends"),
             "Traces samples [begins[r], ends[r]) of region r (luch.adaptive). False when cancelled.")
        .def("cancel", &PyRenderer::cancel, "Callable from any thread.")
        .def("step_progress", &PyRenderer::step_progress, "Share of the running step that is done, 0..1.")
        .def("passes", &PyRenderer::passes, "Blender's pass name -> float32 (H, W, C), bottom row first.")
        .def("deviations", &PyRenderer::deviations,
             "(mean, deviation, share): float32 (H, W, 3) Combined and one draw of its error; the part of the samples "
             "before the mark that parts them. Asks for Settings.estimate_error.")
        .def("device_images", [](const py::object& self) { return PyRenderer::device_images(self); })
        .def("device_view", [](const py::object& self) { return PyRenderer::device_view(self); })
        .def("pass_reads", &PyRenderer::pass_reads)
        .def("film_arrays", [](const py::object& self) { return PyRenderer::film_arrays(self); })
        .def("device_facts", &PyRenderer::device_facts)
        .def("stats", &PyRenderer::stats, "Counts, bytes and seconds.");
}

}  // namespace luch::bindings

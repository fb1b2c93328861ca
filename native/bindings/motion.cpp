// Motion over arrays: transforms between keys, the shutter's curve, rays with times. For tests.
#include <pybind11/stl.h>

#include <algorithm>

#include "bindings/array_scene.h"
#include "bindings/bind.h"
#include "bindings/counts.h"
#include "bindings/device_image.h"
#include "bindings/scene_trees.h"
#include "cpu/accel/scene_trees.h"
#include "cpu/motion/motion_store.h"
#include "luch/accel/pass_by.h"
#include "luch/camera/shutter.h"

namespace luch::bindings {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::vector<cpu::Matrix> matrices_of(const Doubles& rows) {
    std::vector<cpu::Matrix> out(size_t(rows.size()) / 12);
    for (size_t i = 0; i < out.size(); ++i) std::copy_n(rows.data() + 12 * i, 12, out[i].begin());
    return out;
}

FloatArray row_of(const Affine& a) {
    FloatArray out({py::ssize_t{3}, py::ssize_t{4}});
    std::copy_n(a.m, 12, out.mutable_data());
    return out;
}

// Where matrices (K, 3, 4) lead to at a time: to_world and to_object (3, 4).
py::tuple place(const Doubles& matrices, float time) {
    std::vector<TransformKey> keys = cpu::make_keys(matrices_of(matrices));
    if (keys.size() < 2) throw py::value_error("the matrices give no keys");
    Affine to_world = transform_at(keys.data(), {0u, u32(keys.size()), 0u}, time);
    return py::make_tuple(row_of(to_world), row_of(inverse_of(to_world)));
}

FloatArray shutter_times(const std::vector<float>& curve, const FloatArray& u) {
    std::vector<float> table = cpu::invert_shutter_curve(curve);
    ShutterView shutter{};
    shutter.times = table.empty() ? nullptr : table.data();
    shutter.rolling = -1.0f;
    FloatArray out(u.size());
    for (py::ssize_t i = 0; i < u.size(); ++i) out.mutable_data()[i] = shutter_time(shutter, u.data()[i], 0, 1);
    return out;
}

// Of each ray (N, 8), whether it passes by the box (2, 3), whose entries need no widening.
py::array_t<bool> pass_box_by(const FloatArray& box, const FloatArray& rays) {
    const float* b = box.data();
    const PassBox pass = make_pass_box({{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}, {0.0f, 0.0f});
    py::array_t<bool> out(rays.shape(0));
    const Ray* ray = reinterpret_cast<const Ray*>(rays.data());
    for (py::ssize_t i = 0; i < rays.shape(0); ++i, ++ray)
        out.mutable_data()[i] =
            passes_by(pass, ray->origin, ray->direction, max_f(ray->t_min, 0.0f), min_f(ray->t_max, LARGEST_DISTANCE));
    return out;
}

// closest_of hands out pieces of the rays: these are the times that belong to them.
template <class Tracer>
struct AtTimes {
    const Tracer& tracer;
    const FloatArray &rays, &times;
    const float* of(const Ray* first) const {
        return times.size() ? times.data() + (first - reinterpret_cast<const Ray*>(rays.data())) : nullptr;
    }
    void closest(const Ray* first, const u32* kinds, Hit* hits, size_t count) const {
        tracer.closest(first, kinds, hits, count, of(first));
    }
    void any(const Ray* first, const u32* kinds, u8* blocked, size_t count) const {
        tracer.any(first, kinds, blocked, count, of(first));
    }
};

template <class Tracer>
AtTimes<Tracer> at_times(const Tracer& tracer, const FloatArray& rays, const FloatArray& times) {
    return {tracer, rays, times};
}

// Meshes and instances that move, in the CPU's scheme or in that of devices.
class MovingAccel {
    template <class Act>
    auto with(Act&& act) {
        return accel_ ? act(*accel_) : act(*trees_);
    }

 public:
    // As ArrayAccel, without spheres. shapes: (mesh, positions (K, V, 3)); ways: (instance, matrices (K, 3, 4)).
    MovingAccel(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
                const IndexArray& meshes, const IndexArray& instance_meshes, const FloatArray& to_world,
                const FloatArray& to_object, const IndexArray& visibility, int kind, u32 precision,
                u64 flatten_triangles, const std::vector<std::pair<u32, FloatArray>>& shapes,
                const std::vector<std::pair<u32, Doubles>>& ways, bool for_device)
        : pool_(1) {
        ArrayScene scene(positions, triangles, flags, meshes, instance_meshes, to_world, to_object, visibility,
                         FloatArray(0));
        cpu::MotionStore motion;
        for (const auto& [mesh, keys] : shapes)
            motion.add_mesh(mesh, scene.meshes.at(mesh).vertex_count, 0, u32(keys.shape(0)), keys.data(), nullptr);
        for (const auto& [instance, matrices] : ways) motion.add_instance(instance, matrices_of(matrices));
        scene.view.motion = motion.finish(scene.meshes.size(), scene.instances);
        cpu::AccelChoice choice = accel_choice(kind, 1, precision);
        if (for_device)
            trees_ = cpu::SceneTrees::build(scene.view, scene.mesh_flags, pool_, choice, flatten_triangles);
        else
            accel_ = cpu::Accel::build(scene.view, scene.mesh_flags, pool_, choice, flatten_triangles);
    }

    py::tuple closest(const FloatArray& rays, const IndexArray& kinds, const FloatArray& times) {
        return with([&](auto& tracer) { return closest_of(at_times(tracer, rays, times), pool_, rays, kinds); });
    }
    py::array_t<u8> any(const FloatArray& rays, const IndexArray& kinds, const FloatArray& times) {
        return with([&](auto& tracer) { return any_of(at_times(tracer, rays, times), pool_, rays, kinds); });
    }
    // The CPU's scheme: nodes, boxes, primitives and bytes of all rays together, in order.
    py::dict work(const FloatArray& rays, const FloatArray& times, bool shadows) const {
        const Ray* first = reinterpret_cast<const Ray*>(rays.data());
        const size_t count = size_t(rays.shape(0));
        std::vector<Hit> hits(count);
        std::vector<u8> blocked(count);
        Counters total;
        if (shadows)
            accel_->any(first, nullptr, blocked.data(), count, times.data(), &total);
        else
            accel_->closest(first, nullptr, hits.data(), count, times.data(), &total);
        return counts(total);
    }
    bool has_world_apart() const { return trees_ && trees_->has_world_apart(); }
    u64 bytes() const { return accel_ ? accel_->stats().bytes : trees_->stats().bytes; }
    cpu::DeviceImage image() const {
        cpu::DeviceImage out;
        trees_->append(out);
        return out;
    }

 private:
    cpu::ThreadPool pool_;
    std::unique_ptr<cpu::Accel> accel_;
    std::unique_ptr<cpu::SceneTrees> trees_;
};

}  // namespace

void bind_motion(py::module_& m) {
    auto motion = m.def_submodule("motion", "What moves while the shutter is open, over arrays.");
    motion.def("place", &place, "Matrices (K, 3, 4) at evenly spaced times: to_world, to_object at `time`.");
    motion.def("passes_by", &pass_box_by, "Of rays (N, 8), whether they pass by a box (2, 3): no hit in it is lost.");
    motion.def("shutter_times", &shutter_times, "Times of numbers in [0, 1), by the shutter's curve.");
    py::class_<MovingAccel>(motion, "MovingAccel")
        .def(py::init<const FloatArray&, const IndexArray&, const ByteArray&, const IndexArray&, const IndexArray&,
                      const FloatArray&, const FloatArray&, const IndexArray&, int, u32, u64,
                      const std::vector<std::pair<u32, FloatArray>>&, const std::vector<std::pair<u32, Doubles>>&,
                      bool>())
        .def("closest", &MovingAccel::closest)
        .def("any", &MovingAccel::any)
        .def("work", &MovingAccel::work)
        .def("bytes", &MovingAccel::bytes)
        .def("has_world_apart", &MovingAccel::has_world_apart)
        .def("device_image",
             [](const py::object& self) { return device_image(self.cast<MovingAccel&>().image(), self); });
}

}  // namespace luch::bindings

// The scene's trees for devices, over arrays: what tests compare with core.ArrayAccel, and upload.
#include "bindings/scene_trees.h"

#include "bindings/array_scene.h"
#include "bindings/device_image.h"

namespace luch::bindings {
namespace {

class ArraySceneTrees {
 public:
    // As ArrayAccel's.
    ArraySceneTrees(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
                    const IndexArray& meshes, const IndexArray& instance_meshes, const FloatArray& to_world,
                    const FloatArray& to_object, const IndexArray& visibility, int kind, u32 quality, u32 precision,
                    unsigned threads, u64 flatten_triangles, const FloatArray& spheres, u64 leave_from)
        : pool_(threads) {
        ArrayScene scene(positions, triangles, flags, meshes, instance_meshes, to_world, to_object, visibility,
                         spheres);
        cpu::AccelChoice choice = accel_choice(kind, quality, precision);
        choice.leave_from = leave_from;
        py::gil_scoped_release release;
        trees_ = cpu::SceneTrees::build(scene.view, scene.mesh_flags, pool_, choice, flatten_triangles);
    }
    py::tuple closest(const FloatArray& rays, const IndexArray& kinds) {
        return closest_of(*trees_, pool_, rays, kinds);
    }
    py::array_t<u8> any(const FloatArray& rays, const IndexArray& kinds) { return any_of(*trees_, pool_, rays, kinds); }
    bool is_one_group() const { return trees_->is_one_group(); }
    bool has_world_apart() const { return trees_->has_world_apart(); }

    py::dict stats() const {
        cpu::SceneTreesStats s = trees_->stats();
        py::dict out;
        out["triangles"] = s.triangles;
        out["nodes"] = s.nodes;
        out["bytes"] = s.bytes;
        out["duplicate_primitives"] = s.duplicates;
        out["dropped_triangles"] = s.dropped_triangles;
        out["groups"] = s.groups;
        out["entries"] = s.entries;
        out["depth"] = s.depth;
        out["build_seconds"] = s.build_seconds;
        return out;
    }
    const cpu::SceneTrees& trees() const { return *trees_; }
    cpu::DeviceImage image() const {
        cpu::DeviceImage out;
        trees_->append(out);
        return out;
    }

 private:
    cpu::ThreadPool pool_;
    std::unique_ptr<cpu::SceneTrees> trees_;
};

}  // namespace

py::list left_groups(const cpu::SceneTrees& trees, const py::object& owner) {
    py::list out;
    auto borrow = [&](auto array) {
        array.attr("flags").attr("writeable") = false;
        return array;
    };
    for (const cpu::SceneTrees::LeftGroup& group : trees.left_groups()) {
        py::ssize_t refs = py::ssize_t(group.refs);
        py::list places;
        for (auto [block, offset] : group.places) places.append(py::make_tuple(block, offset));
        out.append(py::make_tuple(borrow(FloatArray({refs, py::ssize_t{9}}, group.corners, owner)),
                                  borrow(ByteArray({group.flags ? refs : 0}, group.flags, owner)), places));
    }
    return out;
}

void bind_scene_trees(py::module_& m) {
    py::class_<ArraySceneTrees>(m, "ArraySceneTrees")
        .def(py::init<const FloatArray&, const IndexArray&, const ByteArray&, const IndexArray&, const IndexArray&,
                      const FloatArray&, const FloatArray&, const IndexArray&, int, u32, u32, unsigned, u64,
                      const FloatArray&, u64>())
        .def("closest", &ArraySceneTrees::closest)
        .def("any", &ArraySceneTrees::any)
        .def("stats", &ArraySceneTrees::stats)
        .def("is_one_group", &ArraySceneTrees::is_one_group)
        .def("has_world_apart", &ArraySceneTrees::has_world_apart)
        .def("left_groups",
             [](const py::object& self) { return left_groups(self.cast<ArraySceneTrees&>().trees(), self); })
        .def(
            "device_image",
            [](const py::object& self) { return device_image(self.cast<ArraySceneTrees&>().image(), self); },
            "Blocks and links for luch.cuda.upload.DeviceCopy; the view is the first.");
}

}  // namespace luch::bindings

#include "bindings/scene_reader.h"

#include "bindings/reader.h"

namespace luch::bindings {
ReadScene read_scene(const py::object& scene) {
    ReadScene out;
    out.store = std::make_unique<cpu::SceneStore>();
    Reader reader{scene, *out.store, out.input, {}, {}};
    reader.read_names();
    auto each = [&](const char* list, const std::string& kind, void (Reader::*read)(const py::object&)) {
        for (auto item : py::cast<py::list>(scene.attr(list))) {
            auto one = py::reinterpret_borrow<py::object>(item);
            named(kind + " \"" + py::cast<std::string>(one.attr("name")) + "\"", [&] { (reader.*read)(one); });
        }
    };
    each("meshes", "Mesh", &Reader::read_mesh);
    each("materials", "Material", &Reader::read_material);
    each("objects", "Object", &Reader::read_object);
    named("Instances", [&] { out.dropped_instances = reader.read_instances(scene.attr("instances")); });
    each("images", "Image", &Reader::read_image);
    each("lights", "Light", &Reader::read_lamp);
    named("World", [&] { reader.read_world(scene.attr("world")); });
    reader.read_view();
    out.warnings = std::move(reader.warnings);
    return out;
}

cpu::ViewInput read_view(const py::object& scene) {
    cpu::SceneStore nothing;
    cpu::RenderInput input;
    Reader reader{scene, nothing, input, {}, {}};
    reader.read_names();
    reader.read_view();
    return input;
}

}  // namespace luch::bindings

// Reads luch.scene's dataclasses into what the renderer is made from.
#pragma once
#include <memory>

#include "bindings/bind.h"
#include "cpu/integrator/renderer.h"

namespace luch::bindings {

struct ReadScene {
    std::unique_ptr<cpu::SceneStore> store;
    cpu::RenderInput input;
    std::vector<u32> dropped_instances;  // their objects: a matrix that is not finite, or leaves only a line or a point
    std::vector<std::string> warnings;  // of images
};

// Throws std::invalid_argument for data that does not fit together.
ReadScene read_scene(const py::object& scene);

// Its camera, film, shutter and settings alone, as far as they may change over a prepared scene. Throws likewise.
cpu::ViewInput read_view(const py::object& scene);

}  // namespace luch::bindings

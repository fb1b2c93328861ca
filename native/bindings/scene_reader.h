// Reads luch.scene's dataclasses into what the renderer is made from.
#pragma once
#include <memory>

#include "bindings/bind.h"
#include "cpu/integrator/renderer.h"

namespace luch::bindings {

struct ReadScene {
    std::unique_ptr<cpu::SceneStore> store;
    cpu::RenderInput input;
    u64 dropped_instances = 0;  // matrix not finite or without an inverse
};

// Throws std::invalid_argument for data that does not fit together.
ReadScene read_scene(const py::object& scene);

}  // namespace luch::bindings

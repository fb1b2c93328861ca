// What Python uploads of the scene's trees, beside their image.
#pragma once
#include "bindings/bind.h"
#include "cpu/accel/scene_trees.h"

namespace luch::bindings {

// Of each group that a device builds itself: corners (refs, 9) float32, flags (refs,) uint8 or none, and
// [(block, offset)] where its view belongs, counted from the view's block. The arrays borrow from `owner`'s memory.
py::list left_groups(const cpu::SceneTrees& trees, const py::object& owner);

}  // namespace luch::bindings

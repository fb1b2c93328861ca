// A DeviceImage as Python uploads it.
#pragma once
#include "bindings/bind.h"
#include "cpu/device_image.h"

namespace luch::bindings {

// ([(name, bytes as uint8 array)], [(block, offset, target, target_offset)]). The arrays borrow from `owner`'s
// memory and keep it alive.
py::tuple device_image(const cpu::DeviceImage& image, const py::object& owner);

}  // namespace luch::bindings

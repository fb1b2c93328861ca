// Reads luch.scene.Camera and Film from Python.
#pragma once
#include "bindings/bind.h"
#include "cpu/camera.h"

namespace luch::bindings {

cpu::CameraSpec read_camera(const py::handle& camera);
cpu::FrameSpec read_frame(const py::handle& film);

}  // namespace luch::bindings

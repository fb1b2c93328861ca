// Images given from Python to tests of single operations and programs.
#pragma once
#include <stdexcept>

#include "bindings/bind.h"
#include "luch/shade/scene_view.h"

namespace luch::bindings {

// image: (pixels (H, W, 1..4) contiguous uint8, float16 or float32, is sRGB, ImageAlpha). The caller
// keeps the pixels alive.
inline ImageView view_image(const py::tuple& image) {
    const auto pixels = py::cast<py::array>(image[0]);
    const char kind = pixels.dtype().kind();
    const py::ssize_t size = pixels.itemsize();
    if (pixels.ndim() != 3 || !(pixels.flags() & py::array::c_style) || pixels.shape(2) > 4) {
        throw std::invalid_argument("An image must be a contiguous (H, W, 1..4) array.");
    }
    const bool byte = kind == 'u' && size == 1, half = kind == 'f' && size == 2, single = kind == 'f' && size == 4;
    if (!byte && !half && !single) throw std::invalid_argument("An image must be uint8, float16 or float32.");
    ImageView view{};
    view.pixels = pixels.data();
    view.height = u32(pixels.shape(0));
    view.width = u32(pixels.shape(1));
    view.channels = u8(pixels.shape(2));
    view.format = byte ? PixelFormat::U8 : (half ? PixelFormat::F16 : PixelFormat::F32);
    view.srgb = py::cast<bool>(image[1]);
    view.alpha = u8(py::cast<int>(image[2]));
    return view;
}

}  // namespace luch::bindings

#include "bindings/device_image.h"

namespace luch::bindings {

py::tuple device_image(const cpu::DeviceImage& image, const py::object& owner) {
    py::list blocks, links;
    for (const cpu::DeviceImage::Block& block : image.blocks) {
        // numpy never writes to it: the flag is taken off before it is handed out.
        py::array_t<u8> bytes({py::ssize_t(block.bytes)}, {py::ssize_t{1}}, static_cast<const u8*>(block.data), owner);
        bytes.attr("flags").attr("writeable") = false;
        blocks.append(py::make_tuple(block.name, bytes));
    }
    for (const cpu::DeviceImage::Link& link : image.links)
        links.append(py::make_tuple(link.block, link.offset, link.target, link.target_offset));
    return py::make_tuple(blocks, links);
}

}  // namespace luch::bindings

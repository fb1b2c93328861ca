#include "bindings/reader.h"

#include <algorithm>
#include <cstring>

namespace luch::bindings {

u32 lightgroup_index(const std::vector<std::string>& groups, const std::string& name) {
    for (size_t i = 0; i < groups.size(); i++) {
        if (groups[i] == name && !name.empty()) return u32(i + 1);
    }
    return 0;
}

Program Reader::read_program(const py::object& program, const std::string& owner) {
    cpu::ProgramSource source;
    source.owner = owner;
    auto words = py::cast<Array<u32>>(program.attr("code"));
    auto constants = py::cast<Array<float>>(program.attr("constants"));
    auto tables = py::cast<Array<float>>(program.attr("tables"));
    source.code.assign(words.data(), words.data() + words.size());
    source.constants.assign(constants.data(), constants.data() + constants.size());
    source.tables.assign(tables.data(), tables.data() + tables.size());
    source.register_count = py::cast<u32>(program.attr("register_count"));
    source.flags = py::cast<u32>(program.attr("flags"));
    source.images = py::cast<std::vector<u32>>(program.attr("images"));
    for (const std::string& name : py::cast<std::vector<std::string>>(program.attr("attributes"))) {
        source.attributes.push_back(store.attribute_id(name));
    }
    for (const std::string& name : py::cast<std::vector<std::string>>(program.attr("aovs"))) {
        u32 found = NONE;
        for (size_t i = 0; i < aovs.size(); i++) {
            if (aovs[i] == name) found = u32(i);
        }
        source.aovs.push_back(found);
    }
    return store.add_program(source);
}

void Reader::read_material(const py::object& material) {
    MaterialView view{};
    std::string name = py::cast<std::string>(material.attr("name"));
    view.program = read_program(material.attr("surface"), name);
    view.pass_index = py::cast<float>(material.attr("pass_index"));
    std::string sampling = py::cast<std::string>(material.attr("emission_sampling"));
    // AUTO lights from the sides that the program says it emits on.
    view.emission_sampling = sampling == "NONE" ? 0u : sampling == "FRONT" ? 1u : sampling == "BACK" ? 2u : 3u;
    if (sampling == "AUTO" && !(view.program.flags & PROGRAM_EMISSION_BACK) &&
        (view.program.flags & PROGRAM_EMISSION_FRONT)) {
        view.emission_sampling = 1u;
    } else if (sampling == "AUTO" && (view.program.flags & PROGRAM_EMISSION_BACK) &&
               !(view.program.flags & PROGRAM_EMISSION_FRONT)) {
        view.emission_sampling = 2u;
    }
    view.transparent_shadows = py::cast<bool>(material.attr("transparent_shadows"));
    view.crypto = crypto_id(name);
    view.medium = read_medium(material.attr("volume"));
    view.only_volume = view.medium != NONE && py::cast<bool>(material.attr("only_volume"));
    store.add_material(view);
    input.material_emission_estimate.push_back(read_color(material.attr("emission_estimate")));
}

void Reader::blacken_broken_texels(const std::string& name, const ImageView& view, std::vector<u8>& bytes) {
    size_t texels = size_t(view.width) * view.height, broken = 0;
    auto scan = [&](auto* values, auto exponent) {
        for (size_t t = 0; t < texels; t++, values += view.channels) {
            bool finite = true;
            for (u32 k = 0; k < view.channels; k++) finite = finite && (values[k] & exponent) != exponent;
            if (finite) continue;
            std::fill(values, values + view.channels, decltype(exponent)(0));
            broken++;
        }
    };
    if (view.format == PixelFormat::F32)
        scan(reinterpret_cast<u32*>(bytes.data()), u32(0x7f800000));
    else
        scan(reinterpret_cast<u16*>(bytes.data()), u16(0x7c00));
    if (broken > 0)
        warnings.push_back("Image \"" + name + "\": " + std::to_string(broken) +
                           " pixels are not finite and show black. Save it anew without them.");
}

void Reader::read_image(const py::object& image) {
    py::array pixels = py::cast<py::array>(image.attr("pixels"));
    std::string name = py::cast<std::string>(image.attr("name"));
    pixels = py::module_::import("numpy").attr("ascontiguousarray")(pixels);
    if (pixels.ndim() != 3 || pixels.shape(2) < 1 || pixels.shape(2) > 4 || pixels.size() == 0) {
        throw std::invalid_argument("Image \"" + name + "\": pixels must be (H, W, 1..4).");
    }
    ImageView view{};
    view.height = u32(pixels.shape(0));
    view.width = u32(pixels.shape(1));
    view.channels = u8(pixels.shape(2));
    size_t size = size_t(pixels.dtype().itemsize());
    char kind = pixels.dtype().kind();
    if (kind == 'u' && size == 1)
        view.format = PixelFormat::U8;
    else if (kind == 'f' && size == 2)
        view.format = PixelFormat::F16;
    else if (kind == 'f' && size == 4)
        view.format = PixelFormat::F32;
    else
        throw std::invalid_argument("Image \"" + name + "\": pixels must be uint8, float16 or float32.");
    view.srgb = py::cast<std::string>(image.attr("colorspace")) == "SRGB";
    std::string alpha = py::cast<std::string>(image.attr("alpha"));
    view.alpha = alpha == "PREMULTIPLIED" ? 1 : alpha == "CHANNEL_PACKED" ? 2 : alpha == "NONE" ? 3 : 0;
    std::vector<u8> bytes(size_t(pixels.nbytes()));
    std::memcpy(bytes.data(), pixels.data(), bytes.size());
    if (view.format != PixelFormat::U8) blacken_broken_texels(name, view, bytes);
    store.add_image(view, std::move(bytes));
}

void Reader::read_lamp(const py::object& light) {
    cpu::LampInput in;
    std::string kind = py::cast<std::string>(light.attr("kind"));
    std::string shape = py::cast<std::string>(light.attr("shape"));
    using Shape = cpu::LampShape;
    in.shape = kind == "POINT"        ? Shape::POINT
               : kind == "SPOT"       ? Shape::SPOT
               : kind == "SUN"        ? Shape::SUN
               : shape == "SQUARE"    ? Shape::SQUARE
               : shape == "RECTANGLE" ? Shape::RECTANGLE
               : shape == "DISK"      ? Shape::DISK
                                      : Shape::ELLIPSE;
    auto matrix = read_matrix(light.attr("matrix"), "Light \"" + py::cast<std::string>(light.attr("name")) + "\"");
    for (int i = 0; i < 12; i++) {
        double value = matrix.data()[i];
        in.matrix.m[i] = float(i % 4 == 3 ? value - input.origin[i / 4] : value);
    }
    auto number = [&](const char* name) { return py::cast<float>(light.attr(name)); };
    in.color = read_color(light.attr("color"));
    in.power = number("power");
    in.normalize = py::cast<bool>(light.attr("normalize"));
    in.radius = number("radius");
    in.soft_falloff = py::cast<bool>(light.attr("soft_falloff"));
    in.spot_size = number("spot_size");
    in.spot_blend = number("spot_blend");
    in.angle = number("angle");
    in.size = number("size");
    in.size_y = number("size_y");
    in.spread = number("spread");
    py::object program = light.attr("program");
    in.has_program = !program.is_none();
    if (in.has_program) in.program = read_program(program, py::cast<std::string>(light.attr("name")));
    in.visibility = py::cast<u32>(light.attr("visibility"));
    in.cast_shadow = py::cast<bool>(light.attr("cast_shadow"));
    in.use_mis = py::cast<bool>(light.attr("use_mis"));
    in.max_bounces = py::cast<u32>(light.attr("max_bounces"));
    in.lightgroup = lightgroup_index(lightgroups, py::cast<std::string>(light.attr("lightgroup")));
    in.random = number("random");
    input.lamps.push_back(in);
}

int Reader::automatic_map_width(const py::object& program) const {
    int width = 1024;
    py::list images = scene.attr("images");
    for (u32 index : py::cast<std::vector<u32>>(program.attr("images"))) {
        if (index >= images.size()) continue;
        auto shape = py::cast<py::tuple>(images[index].attr("pixels").attr("shape"));
        width = std::max(width, py::cast<int>(shape[1]));
    }
    return std::min(width, 4096);
}

void Reader::read_world(const py::object& world) {
    if (world.is_none()) return;
    input.world.present = true;
    Program program = read_program(world.attr("program"), py::cast<std::string>(world.attr("name")));
    store.set_world_program(program);
    input.world.visibility = py::cast<u32>(world.attr("visibility"));
    input.world.max_bounces = py::cast<u32>(world.attr("max_bounces"));
    input.world.lightgroup = lightgroup_index(lightgroups, py::cast<std::string>(world.attr("lightgroup")));
    input.media.set_world(read_medium(world.attr("volume")));
    std::string sampling = py::cast<std::string>(world.attr("sampling"));
    input.world_map_width = sampling == "NONE"     ? 0
                            : sampling == "MANUAL" ? py::cast<int>(world.attr("map_resolution"))
                                                   : automatic_map_width(world.attr("program"));
}

}  // namespace luch::bindings

#include "bindings/scene_reader.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <stdexcept>

#include "bindings/camera.h"
#include "bindings/forced.h"
#include "cpu/camera.h"
#include "cpu/filter.h"

namespace luch::bindings {
namespace {

// In the order of luch/samplers.py.
constexpr const char* SAMPLER_NAMES[] = {"SOBOL", "INDEPENDENT", "LATTICE"};
static_assert(std::size(SAMPLER_NAMES) == size_t(SamplerFamily::COUNT));

SamplerFamily named_sampler(const std::string& name) {
    const auto* found = std::find(std::begin(SAMPLER_NAMES), std::end(SAMPLER_NAMES), name);
    if (found == std::end(SAMPLER_NAMES)) {
        throw std::invalid_argument("Settings: the sampler is '" + name +
                                    "'; it can be SOBOL, INDEPENDENT or LATTICE.");
    }
    return SamplerFamily(found - std::begin(SAMPLER_NAMES));
}

template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;

// Arrays that the inputs point into live as long as the reading does.
struct Keep {
    std::vector<py::object> objects;
    template <class T>
    Array<T> array(const py::object& source) {
        Array<T> result = py::cast<Array<T>>(source);
        objects.push_back(result);
        return result;
    }
};

Color read_color(const py::handle& value) {
    auto t = py::cast<std::array<float, 3>>(value);
    return {t[0], t[1], t[2]};
}

u32 lightgroup_index(const std::vector<std::string>& groups, const std::string& name) {
    for (size_t i = 0; i < groups.size(); i++) {
        if (groups[i] == name && !name.empty()) return u32(i + 1);
    }
    return 0;
}

Domain read_domain(const std::string& name, const std::string& mesh) {
    if (name == "POINT") return Domain::POINT;
    if (name == "CORNER") return Domain::CORNER;
    if (name == "FACE") return Domain::FACE;
    if (name == "MESH") return Domain::MESH;
    if (name == "SPHERE") return Domain::SPHERE;
    if (name == "CURVE") return Domain::CURVE;
    if (name == "CURVE_POINT") return Domain::CURVE_POINT;
    if (name == "NONE") return Domain::NONE_;
    throw std::invalid_argument("Mesh \"" + mesh + "\": the domain \"" + name + "\" of an attribute is not known.");
}

constexpr py::ssize_t ROWS = 3, COLUMNS = 4;  // of an affine matrix

Array<double> read_matrix(const py::object& source, const std::string& owner) {
    auto matrix = py::cast<Array<double>>(source);
    if (matrix.size() != ROWS * COLUMNS) throw std::invalid_argument(owner + ": its matrix must be (3, 4).");
    return matrix;
}

// Reads what `owner` names; what Python cannot turn into the number, the text or the array that is wanted, is told so.
template <class Read>
void named(const std::string& owner, Read&& read) {
    const char* remedy = " Export the scene again.";
    try {
        read();
    } catch (const py::cast_error&) {
        throw std::invalid_argument(owner + " holds a number out of its range, or of another kind." + remedy);
    } catch (py::error_already_set& error) {
        if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError)) throw;
        throw std::invalid_argument(owner + " holds what cannot be read (" + error.what() + ")." + remedy);
    }
}

struct Reader {
    py::object scene;
    cpu::SceneStore& store;
    cpu::RenderInput& input;
    std::vector<std::string> lightgroups, aovs, warnings{};

    Program read_program(const py::object& program, const std::string& owner) {
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

    cpu::CurveInput read_curves(const std::string& name, const py::object& curves, Keep& keep) {
        auto points = keep.array<float>(curves.attr("points"));
        auto first = keep.array<u32>(curves.attr("first"));
        auto slots = keep.array<u16>(curves.attr("material_slots"));
        if (points.ndim() != 2 || points.shape(1) != 4 || first.ndim() != 1 || slots.ndim() != 1 ||
            slots.shape(0) != first.shape(0))
            throw std::invalid_argument("Mesh \"" + name +
                                        "\": curves need points (P, 4), place and radius, first (C,) " +
                                        "and material_slots (C,).");
        cpu::CurveInput in = {
            points.data(), size_t(points.shape(0)), first.data(), slots.data(), size_t(first.shape(0)), 0, nullptr};
        if (still() || curves.attr("motion_points").is_none()) return in;
        auto moved = keep.array<float>(curves.attr("motion_points"));
        if (moved.ndim() != 3 || moved.shape(0) < 2 || moved.shape(1) != points.shape(0) || moved.shape(2) != 4)
            throw std::invalid_argument("Mesh \"" + name + "\": motion_points of its curves must be (K, P, 4), " +
                                        "K at least 2.");
        if (all_alike(moved, points.data())) return in;
        in.motion_keys = u32(moved.shape(0));
        in.motion_points = moved.data();
        return in;
    }

    void read_mesh(const py::object& mesh) {
        Keep keep;
        cpu::MeshInput in{};
        in.name = py::cast<std::string>(mesh.attr("name"));
        auto positions = keep.array<float>(mesh.attr("positions"));
        auto triangles = keep.array<u32>(mesh.attr("triangles"));
        auto slots = keep.array<u16>(mesh.attr("material_slots"));
        if (positions.ndim() != 2 || positions.shape(1) != 3 || triangles.ndim() != 2 || triangles.shape(1) != 3 ||
            slots.ndim() != 1 || slots.shape(0) != triangles.shape(0)) {
            throw std::invalid_argument("Mesh \"" + in.name + "\": positions must be (V, 3), triangles (T, 3), " +
                                        "material_slots (T,).");
        }
        in.positions = positions.data();
        in.vertex_count = size_t(positions.shape(0));
        in.triangles = triangles.data();
        in.triangle_count = size_t(triangles.shape(0));
        in.material_slots = slots.data();
        if (!mesh.attr("spheres").is_none()) {
            auto spheres = keep.array<float>(mesh.attr("spheres"));
            if (spheres.ndim() != 2 || spheres.shape(1) != 4)
                throw std::invalid_argument("Mesh \"" + in.name + "\": spheres must be (S, 4): centre and radius.");
            in.spheres = spheres.data();
            in.sphere_count = size_t(spheres.shape(0));
        }
        if (!mesh.attr("curves").is_none()) in.curves = read_curves(in.name, mesh.attr("curves"), keep);
        if (!mesh.attr("normals").is_none()) {
            auto normals = keep.array<float>(mesh.attr("normals"));
            in.normals_domain = read_domain(py::cast<std::string>(mesh.attr("normals_domain")), in.name);
            if (in.normals_domain != Domain::POINT && in.normals_domain != Domain::CORNER)
                throw std::invalid_argument("Mesh \"" + in.name + "\": normals are of its points or corners.");
            size_t rows = in.normals_domain == Domain::POINT ? in.vertex_count : in.triangle_count * 3;
            if (size_t(normals.size()) != rows * 3) {
                throw std::invalid_argument("Mesh \"" + in.name + "\": normals do not fit their domain.");
            }
            in.normals = normals.data();
        }
        for (auto item : py::cast<py::dict>(mesh.attr("attributes"))) {
            py::object attribute = py::reinterpret_borrow<py::object>(item.second);
            auto data = keep.array<float>(attribute.attr("data"));
            cpu::AttributeInput a;
            a.name = py::cast<std::string>(item.first);
            a.data = data.data();
            if (data.ndim() != 1 && data.ndim() != 2)
                throw std::invalid_argument("Mesh \"" + in.name + "\": attribute \"" + a.name + "\" must be (N, C).");
            a.rows = size_t(data.shape(0));
            a.channels = data.ndim() > 1 ? u32(data.shape(1)) : 1u;
            a.domain = read_domain(py::cast<std::string>(attribute.attr("domain")), in.name);
            in.attributes.push_back(a);
        }
        read_mesh_motion(mesh, keep, in);
        in.uv_active = py::cast<std::string>(mesh.attr("uv_active"));
        in.color_active = py::cast<std::string>(mesh.attr("color_active"));
        in.texture_location = read_color(mesh.attr("texture_location"));
        in.texture_size = read_color(mesh.attr("texture_size"));
        store.add_mesh(in);
    }

    // Its number among the scene's media; NONE where there is none.
    u32 read_medium(const py::object& medium) {
        if (medium.is_none()) return NONE;
        cpu::MediumInput in;
        in.absorption = read_color(medium.attr("absorption"));
        in.emission = read_color(medium.attr("emission"));
        for (auto phase : py::cast<py::list>(medium.attr("scattering"))) {
            in.scattering.push_back({py::cast<std::string>(phase.attr("kind")), read_color(phase.attr("scattering")),
                                     py::cast<float>(phase.attr("a")), py::cast<float>(phase.attr("b"))});
        }
        return input.media.add(in);
    }

    bool still() const { return scene.attr("shutter").is_none(); }

    // Whether every key is the shape itself, bit for bit: then it stands still, and is traced as what stands still.
    static bool all_alike(const Array<float>& keys, const float* shape) {
        size_t count = size_t(keys.shape(0)), size = size_t(keys.size()) / count;
        for (size_t k = 0; k < count; k++)
            if (size && std::memcmp(keys.data() + k * size, shape, size * sizeof(float)) != 0) return false;
        return true;
    }

    void read_mesh_motion(const py::object& mesh, Keep& keep, cpu::MeshInput& in) {
        if (still() || mesh.attr("motion_positions").is_none()) return;
        auto positions = keep.array<float>(mesh.attr("motion_positions"));
        if (positions.ndim() != 3 || positions.shape(0) < 2 || size_t(positions.shape(1)) != in.vertex_count ||
            positions.shape(2) != 3)
            throw std::invalid_argument("Mesh \"" + in.name + "\": motion_positions must be (K, V, 3), K at least 2.");
        bool stands = all_alike(positions, in.positions);
        const float* normals = nullptr;
        if (in.normals) {
            size_t rows = in.normals_domain == Domain::POINT ? in.vertex_count : in.triangle_count * 3;
            auto given = keep.array<float>(mesh.attr("motion_normals"));
            if (size_t(given.size()) != size_t(positions.shape(0)) * rows * 3)
                throw std::invalid_argument("Mesh \"" + in.name + "\": motion_normals do not fit motion_positions.");
            normals = given.data();
            stands = stands && all_alike(given, in.normals);
        }
        if (stands) return;
        in.motion_keys = u32(positions.shape(0));
        in.motion_positions = positions.data();
        in.motion_normals = normals;
    }

    void read_material(const py::object& material) {
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

    float crypto_id(const std::string& name) {
        return py::cast<float>(py::module_::import("luch.cryptomatte").attr("name_to_id")(name));
    }

    void read_object(const py::object& object) {
        cpu::ObjectInput in{};
        in.mesh = py::cast<u32>(object.attr("mesh"));
        in.materials = py::cast<std::vector<u32>>(object.attr("materials"));
        in.pass_index = py::cast<float>(object.attr("pass_index"));
        auto color = py::cast<std::array<float, 4>>(object.attr("color"));
        std::copy(color.begin(), color.end(), in.color);
        in.visibility = py::cast<u32>(object.attr("visibility"));
        in.holdout = py::cast<bool>(object.attr("holdout"));
        in.shadow_catcher = py::cast<bool>(object.attr("shadow_catcher"));
        in.lightgroup = lightgroup_index(lightgroups, py::cast<std::string>(object.attr("lightgroup")));
        in.shadow_terminator = py::cast<float>(object.attr("shadow_terminator"));
        in.crypto_object = crypto_id(py::cast<std::string>(object.attr("name")));
        in.crypto_asset = crypto_id(py::cast<std::string>(object.attr("asset")));
        for (auto item : py::cast<py::dict>(object.attr("attributes"))) {
            in.values.emplace_back(py::cast<std::string>(item.first), py::cast<std::array<float, 4>>(item.second));
        }
        store.add_object(in);
    }

    cpu::Matrix relative_to_origin(const double* matrix) const {
        cpu::Matrix m;
        std::copy(matrix, matrix + 12, m.begin());
        for (size_t row = 0; row < 3; row++) m[row * 4 + 3] -= input.origin[row];
        return m;
    }

    // By instance, as InstanceInput::motion; none: nothing moves.
    std::vector<std::vector<cpu::Matrix>> read_instance_motion(const py::object& motion, size_t instance_count) {
        std::vector<std::vector<cpu::Matrix>> out;
        if (still() || motion.is_none()) return out;
        auto instance = py::cast<Array<u32>>(motion.attr("instance"));
        auto keys = py::cast<Array<u32>>(motion.attr("keys"));
        auto matrix = py::cast<Array<double>>(motion.attr("matrix"));
        size_t moving = size_t(instance.size()), sum = 0;
        for (size_t i = 0; i < size_t(keys.size()); i++) sum += keys.data()[i];
        if (size_t(keys.size()) != moving || size_t(matrix.size()) != sum * 12)
            throw std::invalid_argument("Instances: the arrays of their motion differ in length.");
        out.resize(instance_count);
        const double* next = matrix.data();
        for (size_t i = 0; i < moving; i++) {
            if (instance.data()[i] >= instance_count)
                throw std::invalid_argument("Instances: their motion names one that is not there.");
            for (u32 k = 0; k < keys.data()[i]; k++, next += 12)
                out[instance.data()[i]].push_back(relative_to_origin(next));
        }
        return out;
    }

    std::vector<u32> read_instances(const py::object& instances) {
        if (instances.is_none()) return {};
        auto object = py::cast<Array<u32>>(instances.attr("object"));
        auto matrix = py::cast<Array<double>>(instances.attr("matrix"));
        auto random = py::cast<Array<float>>(instances.attr("random"));
        auto generated = py::cast<Array<float>>(instances.attr("generated"));
        auto uv = py::cast<Array<float>>(instances.attr("uv"));
        size_t count = size_t(object.size());
        if (size_t(matrix.size()) != count * 12 || size_t(random.size()) != count ||
            size_t(generated.size()) != count * 3 || size_t(uv.size()) != count * 2) {
            throw std::invalid_argument("Instances: the arrays differ in length.");
        }
        std::vector<u32> dropped;
        std::vector<std::vector<cpu::Matrix>> motion = read_instance_motion(instances.attr("motion"), count);
        for (size_t i = 0; i < count; i++) {
            cpu::InstanceInput in{};
            in.object = object.data()[i];
            std::copy(matrix.data() + i * 12, matrix.data() + i * 12 + 12, in.matrix);
            for (int row = 0; row < 3; row++) in.matrix[row * 4 + 3] -= input.origin[row];
            in.random = random.data()[i];
            in.generated = {generated.data()[i * 3], generated.data()[i * 3 + 1], generated.data()[i * 3 + 2]};
            in.uv = {uv.data()[i * 2], uv.data()[i * 2 + 1]};
            if (!motion.empty()) in.motion = std::move(motion[i]);
            if (!store.add_instance(in)) dropped.push_back(in.object);
        }
        return dropped;
    }

    // One texel that is not finite would spread to all that is interpolated with it and to every table that sums over it.
    void blacken_broken_texels(const std::string& name, const ImageView& view, std::vector<u8>& bytes) {
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

    void read_image(const py::object& image) {
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

    void read_lamp(const py::object& light) {
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

    // The importance map is as fine as the widest image that the world shows, within bounds: coarser misses
    // suns, finer than 4,096 costs 100 MB and finds no more.
    int automatic_map_width(const py::object& program) const {
        int width = 1024;
        py::list images = scene.attr("images");
        for (u32 index : py::cast<std::vector<u32>>(program.attr("images"))) {
            if (index >= images.size()) continue;
            auto shape = py::cast<py::tuple>(images[index].attr("pixels").attr("shape"));
            width = std::max(width, py::cast<int>(shape[1]));
        }
        return std::min(width, 4096);
    }

    void read_world(const py::object& world) {
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

    void read_camera_motion(const py::object& motion, cpu::CameraSpec spec, const cpu::FrameSpec& frame) {
        if (still() || motion.is_none()) return;
        auto matrix = py::cast<Array<double>>(motion.attr("matrix"));
        if (matrix.size() % 12 != 0)
            throw std::invalid_argument("Camera: the matrices of its motion must be (K, 3, 4).");
        std::vector<cpu::Matrix> places;
        for (py::ssize_t at = 0; at < matrix.size(); at += 12) {
            std::copy(matrix.data() + at, matrix.data() + at + 12, spec.matrix);
            CameraView view = cpu::make_camera_view(spec, frame, input.origin);
            std::copy(std::begin(view.to_world.m), std::end(view.to_world.m), places.emplace_back().begin());
        }
        bool moves = std::any_of(places.begin(), places.end(), [&](const cpu::Matrix& m) { return m != places[0]; });
        if (moves) input.motion.camera = cpu::make_keys(places);
        if (motion.attr("lens_mm").is_none() || spec.kind != "PERSP") return;
        auto lens = py::cast<std::array<double, 2>>(motion.attr("lens_mm"));
        input.motion.zooms = lens[0] != spec.lens_mm || lens[1] != spec.lens_mm;
        for (size_t end = 0; end < 2; end++) {
            spec.lens_mm = lens[end];
            input.motion.camera_ends[end] = cpu::make_camera_view(spec, frame, input.origin);
        }
    }

    void read_shutter(const py::object& shutter) {
        if (shutter.is_none()) return;
        input.motion.shutter = true;
        py::object curve = shutter.attr("curve");
        if (!curve.is_none()) {
            auto open = py::cast<Array<float>>(curve);
            input.motion.curve.assign(open.data(), open.data() + open.size());
        }
        if (!shutter.attr("rolling").is_none()) input.motion.rolling = py::cast<float>(shutter.attr("rolling"));
    }

    void read_camera(const py::object& camera, const py::object& film) {
        cpu::CameraSpec spec = bindings::read_camera(camera);
        cpu::FrameSpec frame = read_frame(film);
        input.camera = cpu::make_camera_view(spec, frame, input.origin);
        read_camera_motion(camera.attr("motion"), spec, frame);
        input.frame_width = u32(frame.width);
        input.frame_height = u32(frame.height);
    }

    void read_film(const py::object& film) {
        input.filter = cpu::make_pixel_filter(py::cast<std::string>(film.attr("filter")),
                                              py::cast<double>(film.attr("filter_width")));
        cpu::FilmSpec& spec = input.film;
        spec.width = py::cast<u32>(film.attr("width"));
        spec.height = py::cast<u32>(film.attr("height"));
        if (!film.attr("border").is_none()) {
            auto border = py::cast<std::array<u32, 4>>(film.attr("border"));
            spec.x0 = border[0], spec.y0 = border[1];
            spec.width = border[2] - border[0], spec.height = border[3] - border[1];
        }
        std::copy(input.origin, input.origin + 3, spec.origin);
        spec.exposure = py::cast<float>(film.attr("exposure"));
        spec.passes = py::cast<std::vector<std::string>>(film.attr("passes"));
        spec.cryptomatte_depth = py::cast<u32>(film.attr("cryptomatte_depth"));
        spec.lightgroups = lightgroups;
        for (auto aov : py::cast<py::list>(film.attr("aovs"))) {
            auto pair = py::cast<py::tuple>(aov);
            spec.aovs.push_back({py::cast<std::string>(pair[0]), py::cast<std::string>(pair[1]) == "COLOR"});
        }
        auto mist = py::cast<py::tuple>(film.attr("mist"));
        input.mist_start = py::cast<float>(mist[0]);
        input.mist_depth = py::cast<float>(mist[1]);
        std::string falloff = py::cast<std::string>(mist[2]);
        input.mist_exponent = falloff == "LINEAR" ? 1.0f : falloff == "INVERSE_QUADRATIC" ? 0.5f : 2.0f;
        input.limits.film_transparent = py::cast<bool>(film.attr("transparent"));
        input.limits.film_transparent_glass = py::cast<bool>(film.attr("transparent_glass"));
        input.limits.film_transparent_roughness = py::cast<float>(film.attr("transparent_roughness"));
        input.limits.alpha_threshold = py::cast<float>(film.attr("alpha_threshold"));
    }

    // What everything else is read with.
    void read_names() {
        py::object film = scene.attr("film");
        lightgroups = py::cast<std::vector<std::string>>(film.attr("lightgroups"));
        for (auto aov : py::cast<py::list>(film.attr("aovs")))
            aovs.push_back(py::cast<std::string>(py::cast<py::tuple>(aov)[0]));
        auto origin = py::cast<std::array<double, 3>>(scene.attr("origin"));
        std::copy(origin.begin(), origin.end(), input.origin);
    }

    void read_view() {
        py::object film = scene.attr("film");
        named("Film", [&] { read_film(film); });
        named("Settings", [&] { read_settings(scene.attr("settings")); });
        named("Camera", [&] { read_camera(scene.attr("camera"), film); });
        named("Shutter", [&] { read_shutter(scene.attr("shutter")); });
    }

    void read_curve_settings(const py::object& settings) {
        constexpr std::pair<const char*, CurveShape> SHAPES[] = {
            {"RIBBON", CurveShape::RIBBON}, {"THICK", CurveShape::THICK}, {"THICK_LINEAR", CurveShape::THICK_LINEAR}};
        auto name = py::cast<std::string>(settings.attr("curve_shape"));
        auto found = std::find_if(std::begin(SHAPES), std::end(SHAPES), [&](auto& s) { return name == s.first; });
        if (found == std::end(SHAPES))
            throw std::invalid_argument("Curve shape \"" + name +
                                        "\" is not known; take RIBBON, THICK or THICK_LINEAR.");
        store.view().curve_shape = found->second;
        store.view().log2_pieces = log2_pieces_of(found->second, py::cast<u32>(settings.attr("curve_subdivisions")));
    }

    void read_settings(const py::object& settings) {
        auto count = [&](const char* name) { return py::cast<u32>(settings.attr(name)); };
        auto number = [&](const char* name) { return py::cast<float>(settings.attr(name)); };
        PathLimits& limits = input.limits;
        // As in Cycles 0 bounces still mean direct light, so limits count one more; of transparency 0 means none.
        limits.bounces = count("max_bounces") + 1;
        limits.diffuse = count("diffuse_bounces") + 1;
        limits.glossy = count("glossy_bounces") + 1;
        limits.transmission = count("transmission_bounces") + 1;
        limits.volume = count("volume_bounces") + 1;
        limits.transparent = count("transparent_bounces");
        limits.min_bounces = count("min_light_bounces") + 1;
        limits.min_transparent = count("min_transparent_bounces") + 1;
        limits.clamp_direct = number("clamp_direct");
        limits.clamp_indirect = number("clamp_indirect");
        limits.filter_glossy = number("filter_glossy");
        limits.caustics_reflective = py::cast<bool>(settings.attr("caustics_reflective"));
        limits.caustics_refractive = py::cast<bool>(settings.attr("caustics_refractive"));
        limits.ao_distance = number("ao_distance");
        input.light_tree = py::cast<bool>(settings.attr("light_tree"));
        read_curve_settings(settings);
        input.seed = count("seed");
        input.sampler = named_sampler(py::cast<std::string>(settings.attr("sampler")));
        input.samples = count("samples");
        input.first_sample = count("first_sample");
        input.samples_in_all = count("samples_in_all");
        input.threads = count("threads");
        input.film.marks = py::cast<bool>(settings.attr("estimate_error"));
        input.accel = cpu::accel_request(py::cast<std::string>(settings.attr("accelerator")),
                                         py::cast<std::string>(settings.attr("precision")));
        for (const auto& name : py::cast<std::vector<std::string>>(settings.attr("force_effects")))
            force(input.forced, name);
        double time_limit_s = py::cast<double>(settings.attr("time_limit"));
        if (time_limit_s > 0.0) input.accel.time_limit_s = time_limit_s;
    }
};

}  // namespace

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

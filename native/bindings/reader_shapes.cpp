#include "bindings/reader.h"

#include <algorithm>
#include <cstring>

namespace luch::bindings {
namespace {

constexpr py::ssize_t ROWS = 3, COLUMNS = 4;  // of an affine matrix

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

}  // namespace

Array<double> read_matrix(const py::object& source, const std::string& owner) {
    auto matrix = py::cast<Array<double>>(source);
    if (matrix.size() != ROWS * COLUMNS) throw std::invalid_argument(owner + ": its matrix must be (3, 4).");
    return matrix;
}

cpu::CurveInput Reader::read_curves(const std::string& name, const py::object& curves, Keep& keep) {
    auto points = keep.array<float>(curves.attr("points"));
    auto first = keep.array<u32>(curves.attr("first"));
    auto slots = keep.array<u16>(curves.attr("material_slots"));
    if (points.ndim() != 2 || points.shape(1) != 4 || first.ndim() != 1 || slots.ndim() != 1 ||
        slots.shape(0) != first.shape(0))
        throw std::invalid_argument("Mesh \"" + name + "\": curves need points (P, 4), place and radius, first (C,) " +
                                    "and material_slots (C,).");
    cpu::CurveInput in = {points.data(), size_t(points.shape(0)), first.data(), slots.data(), size_t(first.shape(0)), 0,
                          nullptr};
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

void Reader::read_mesh(const py::object& mesh) {
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

u32 Reader::read_medium(const py::object& medium) {
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

bool Reader::all_alike(const Array<float>& keys, const float* shape) {
    size_t count = size_t(keys.shape(0)), size = size_t(keys.size()) / count;
    for (size_t k = 0; k < count; k++)
        if (size && std::memcmp(keys.data() + k * size, shape, size * sizeof(float)) != 0) return false;
    return true;
}

void Reader::read_mesh_motion(const py::object& mesh, Keep& keep, cpu::MeshInput& in) {
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

float Reader::crypto_id(const std::string& name) {
    return py::cast<float>(py::module_::import("luch.cryptomatte").attr("name_to_id")(name));
}

void Reader::read_object(const py::object& object) {
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

cpu::Matrix Reader::relative_to_origin(const double* matrix) const {
    cpu::Matrix m;
    std::copy(matrix, matrix + 12, m.begin());
    for (size_t row = 0; row < 3; row++) m[row * 4 + 3] -= input.origin[row];
    return m;
}

std::vector<std::vector<cpu::Matrix>> Reader::read_instance_motion(const py::object& motion, size_t instance_count) {
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

std::vector<u32> Reader::read_instances(const py::object& instances) {
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

}  // namespace luch::bindings

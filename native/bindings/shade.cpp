// The operation table, and programs over arrays of points: for the program builder and for tests.
#include <algorithm>
#include <cstring>
#include <vector>

#include "bindings/bind.h"
#include "bindings/images.h"
#include "cpu/geometry/islands.h"
#include "cpu/shade/link.h"
#include "luch/camera/camera.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Words = py::array_t<u32, py::array::c_style | py::array::forcecast>;

template <class T, class Array>
std::vector<T> to_vector(const Array& array) {
    return std::vector<T>(array.data(), array.data() + array.size());
}

py::list op_table() {
    py::list table;
    for (int op = 0; op < cpu::op_count(); op++) {
        const cpu::OpInfo& info = cpu::op_info(op);
        table.append(py::dict(py::arg("name") = info.name, py::arg("code") = op, py::arg("inputs") = info.inputs,
                              py::arg("outputs") = info.outputs, py::arg("params") = info.params,
                              py::arg("closure") = info.closure, py::arg("constant") = info.constant));
    }
    return table;
}

// A scene of one plane or mesh in one instance, enough for every input operation.
struct TestScene {
    cpu::LinkedPrograms programs;
    std::vector<float> positions, attribute_data, normals;
    std::vector<u32> triangles;
    std::vector<AttributeView> attributes;
    MeshView mesh{};
    InstanceView instance{};
    ObjectView object{};
    CameraView camera{};
    MaterialView material{};
    u32 material_table = 0;
    std::vector<u16> material_slots;
    std::vector<ImageView> images;
    SceneView view{};
};

Affine to_affine(const Floats& matrix) {
    if (matrix.size() != 12) throw py::value_error("a matrix must have shape (3, 4)");
    Affine affine;
    std::copy(matrix.data(), matrix.data() + 12, affine.m);
    return affine;
}

Vec3 to_vec3(const py::object& value) {
    Floats v = py::cast<Floats>(value);
    if (v.size() != 3) throw py::value_error("a vector must have 3 components");
    return {v.data()[0], v.data()[1], v.data()[2]};
}

constexpr Affine IDENTITY{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

void load_mesh(TestScene& scene, const py::dict& mesh) {
    scene.positions = to_vector<float>(py::cast<Floats>(mesh["positions"]));
    scene.triangles = to_vector<u32>(py::cast<Words>(mesh["triangles"]));
    scene.material_slots.assign(scene.triangles.size() / 3, 0);
    scene.mesh.vertex_count = u32(scene.positions.size() / 3);
    scene.mesh.triangle_count = u32(scene.triangles.size() / 3);
    if (mesh.contains("normals")) {  // per vertex, or per corner of each triangle
        scene.normals = to_vector<float>(py::cast<Floats>(mesh["normals"]));
        const bool corners = scene.normals.size() == scene.triangles.size() * 3;
        scene.mesh.normals_domain = corners ? Domain::CORNER : Domain::POINT;
    }
    if (mesh.contains("texture_location")) scene.mesh.texture_location = to_vec3(mesh["texture_location"]);
    if (mesh.contains("texture_size")) scene.mesh.texture_size = to_vec3(mesh["texture_size"]);
    if (!mesh.contains("attributes")) return;
    for (const auto& item : mesh["attributes"]) {  // (data (n, channels), domain name)
        auto pair = py::cast<py::tuple>(item);
        Floats data = py::cast<Floats>(pair[0]);
        std::string domain = py::cast<std::string>(pair[1]);
        Domain code = domain == "POINT"    ? Domain::POINT
                      : domain == "CORNER" ? Domain::CORNER
                      : domain == "FACE"   ? Domain::FACE
                      : domain == "MESH"   ? Domain::MESH
                                           : Domain::NONE_;
        u8 channels = code == Domain::NONE_ ? 0 : u8(data.ndim() == 2 ? data.shape(1) : 1);
        scene.attributes.push_back({u32(scene.attribute_data.size()), channels, code});
        scene.attribute_data.insert(scene.attribute_data.end(), data.data(), data.data() + data.size());
    }
}

// An orthographic camera: matrices, metres per pixel, and the frame in pixels.
void load_camera(TestScene& scene, const py::dict& camera) {
    const float metres = py::cast<float>(camera["pixel_size"]);
    const float width = py::cast<float>(camera["width"]), height = py::cast<float>(camera["height"]);
    scene.camera.kind = CameraKind::ORTHOGRAPHIC;
    scene.camera.to_world = to_affine(py::cast<Floats>(camera["to_world"]));
    scene.camera.to_camera = to_affine(py::cast<Floats>(camera["to_camera"]));
    scene.camera.centre = {0.5f * width, 0.5f * height};
    scene.camera.scale = {metres, metres};
    scene.view.camera = &scene.camera;
    scene.view.frame_size = {width, height};
}

void load_scene(TestScene& scene, const py::dict& description) {
    auto u32_of = [&](const char* name, u32 fallback) {
        return description.contains(name) ? py::cast<u32>(description[name]) : fallback;
    };
    auto affine_of = [&](const char* name) {
        return description.contains(name) ? to_affine(py::cast<Floats>(description[name])) : IDENTITY;
    };
    auto float_of = [&](const char* name) {
        return description.contains(name) ? py::cast<float>(description[name]) : 0.0f;
    };
    scene.mesh.texture_size = make_vec3(1.0f);
    if (description.contains("mesh")) load_mesh(scene, py::cast<py::dict>(description["mesh"]));
    scene.instance.to_world = affine_of("to_world");
    scene.instance.to_object = affine_of("to_object");
    scene.instance.material_count = 1;
    scene.instance.random = float_of("object_random");
    scene.object.pass_index = float_of("object_index");
    scene.material.pass_index = float_of("material_index");
    for (int k = 0; k < 4; k++) scene.object.color[k] = 1.0f;
    scene.object.first_attribute = NONE;
    if (description.contains("object_color")) {
        Floats color = py::cast<Floats>(description["object_color"]);
        if (color.size() != 4) throw py::value_error("object_color must have 4 components");
        std::copy(color.data(), color.data() + 4, scene.object.color);
    }
    if (description.contains("object_location")) scene.object.location = to_vec3(description["object_location"]);
    SceneView& view = scene.view;
    if (description.contains("origin")) view.origin = to_vec3(description["origin"]);
    view.uv_attribute = u32_of("uv_attribute", NONE);
    view.color_attribute = u32_of("color_attribute", NONE);
    view.generated_attribute = u32_of("generated_attribute", NONE);
    view.tangent_attribute = u32_of("tangent_attribute", NONE);
    if (description.contains("camera")) load_camera(scene, py::cast<py::dict>(description["camera"]));
    view.positions = scene.positions.data();
    view.normals = scene.normals.data();
    view.triangles = scene.triangles.data();
    view.material_slots = scene.material_slots.data();
    if (description.contains("images")) {
        for (const auto& image : description["images"]) scene.images.push_back(view_image(py::cast<py::tuple>(image)));
    }
    view.images = scene.images.data();
    view.image_count = u32(scene.images.size());
    view.attribute_data = scene.attribute_data.data();
    view.attributes = scene.attributes.data();
    view.meshes = &scene.mesh;
    view.instances = &scene.instance;
    view.objects = &scene.object;
    view.material_table = &scene.material_table;
    view.materials = &scene.material;
    view.mesh_count = view.instance_count = view.object_count = view.material_count = 1;
    scene.programs.fill(view);
}

struct PointColumn {
    const char* name;
    int width;
    float* (*at)(ShadePoints&, int);
};

#define LUCH_COLUMN(NAME, FIELD) \
    [](ShadePoints& p, int k) { return k == 0 ? p.FIELD##x : k == 1 ? p.FIELD##y : p.FIELD##z; }
constexpr PointColumn COLUMNS[] = {
    {"position", 3, LUCH_COLUMN("position", p)},
    {"normal", 3, LUCH_COLUMN("normal", n)},
    {"geometric_normal", 3, LUCH_COLUMN("geometric_normal", g)},
    {"incoming", 3, LUCH_COLUMN("incoming", i)},
    {"uv", 2, [](ShadePoints& p, int k) { return k == 0 ? p.u : p.v; }},
    {"ray_length", 1, [](ShadePoints& p, int) { return p.ray_length; }},
    {"footprint", 1, [](ShadePoints& p, int) { return p.footprint; }},
};
#undef LUCH_COLUMN

void load_points(ShadePoints& points, const py::dict& arrays, size_t first, int count) {
    points.count = count;
    for (int lane = 0; lane < SHADE_LANES; lane++) {
        points.nz[lane] = points.gz[lane] = points.iz[lane] = 1.0f;
        points.flags[lane] = PATH_CAMERA;
    }
    for (const PointColumn& column : COLUMNS) {
        if (!arrays.contains(column.name)) continue;
        Floats data = py::cast<Floats>(arrays[column.name]);
        for (int lane = 0; lane < count; lane++) {
            for (int k = 0; k < column.width; k++) {
                column.at(points, k)[lane] = data.data()[(first + size_t(lane)) * size_t(column.width) + size_t(k)];
            }
        }
    }
    auto words = [&](const char* name, u32* into) {
        if (!arrays.contains(name)) return;
        Words data = py::cast<Words>(arrays[name]);
        for (int lane = 0; lane < count; lane++) into[lane] = data.data()[first + size_t(lane)];
    };
    words("flags", points.flags);
    words("prim", points.prim);
    words("depth", points.depth);
    words("transparent_depth", points.transparent_depth);
    words("instance", points.instance);
    words("seed", points.seed);
}

// Runs a program over N points; returns registers (register_count, N), emission (N, 3), transparent
// (N, 3), holdout (N,), lobe counts (N,).
py::dict run_program(const Words& code, const Floats& constants, u32 register_count, const Floats& tables, size_t count,
                     const py::dict& points, const py::dict& scene_description) {
    TestScene scene;
    cpu::ProgramSource source;
    source.owner = "test";
    source.code = to_vector<u32>(code);
    source.constants = to_vector<float>(constants);
    source.tables = to_vector<float>(tables);
    source.register_count = register_count;
    for (u32 k = 0; k < 64; k++) {
        source.images.push_back(k);
        source.attributes.push_back(k);
        source.aovs.push_back(k);
    }
    Program program = scene.programs.add(source);
    load_scene(scene, scene_description);

    py::array_t<float> values({size_t(register_count), count});
    py::array_t<float> emission({count, size_t(3)}), transparent({count, size_t(3)}), holdout(count);
    py::array_t<int> lobes(count);
    cpu::Registers scratch(program);
    float* registers = scratch.data();
    std::vector<ClosureSet> closures(SHADE_LANES);
    auto chunk = std::make_unique<ShadePoints>();
    for (size_t first = 0; first < count; first += SHADE_LANES) {
        const int lanes = int(std::min(count - first, size_t(SHADE_LANES)));
        *chunk = ShadePoints{};
        load_points(*chunk, points, first, lanes);
        cpu::run_program(scene.view, program, *chunk, closures.data(), registers);
        for (int lane = 0; lane < lanes; lane++) {
            const size_t row = first + size_t(lane);
            for (u32 k = 0; k < register_count; k++) {
                values.mutable_at(k, row) = registers[size_t(k) * SHADE_LANES + size_t(lane)];
            }
            const ClosureSet& set = closures[size_t(lane)];
            std::memcpy(emission.mutable_data(row, 0), &set.emission, sizeof(Vec3));
            std::memcpy(transparent.mutable_data(row, 0), &set.transparent, sizeof(Vec3));
            holdout.mutable_at(row) = set.holdout;
            lobes.mutable_at(row) = set.count;
        }
    }
    return py::dict(py::arg("registers") = values, py::arg("emission") = emission, py::arg("transparent") = transparent,
                    py::arg("holdout") = holdout, py::arg("lobes") = lobes);
}

py::array_t<float> island_random(size_t vertex_count, const Words& edges, const Words& triangles) {
    auto check = [&](const Words& indices, py::ssize_t width) {
        if (indices.size() % width != 0) throw py::value_error("edges are pairs, triangles triples of vertices");
        for (py::ssize_t k = 0; k < indices.size(); k++) {
            if (indices.data()[k] >= vertex_count) throw py::value_error("a vertex index is out of range");
        }
    };
    check(edges, 2);
    check(triangles, 3);
    const std::vector<float> random = cpu::island_random(vertex_count, edges.data(), size_t(edges.size()) / 2,
                                                         triangles.data(), size_t(triangles.size()) / 3);
    return py::array_t<float>(py::ssize_t(random.size()), random.data());
}

}  // namespace

void bind_shade(py::module_& m) {
    auto shade = m.def_submodule("shade", "Shader operations and programs.");
    shade.attr("LANES") = SHADE_LANES;
    shade.def("island_random", &island_random, py::arg("vertex_count"), py::arg("edges"), py::arg("triangles"),
              "A number in 0..1 per triangle, the same over each connected part. edges (E, 2), triangles (T, 3).");
    shade.def("op_table", &op_table, "Every operation: name, code, inputs, outputs, params, closure, constant.");
    shade.def("run_program", &run_program, py::arg("code"), py::arg("constants"), py::arg("register_count"),
              py::arg("tables"), py::arg("count"), py::arg("points") = py::dict(), py::arg("scene") = py::dict(),
              "Runs a program over `count` points; points and scene are dicts of arrays.");
}

}  // namespace luch::bindings

// Lights on their own, for tests: a store built from arrays, samples and densities over arrays of points.
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <vector>

#include "bindings/bind.h"
#include "cpu/lights.h"
#include "cpu/thread_pool.h"
#include "luch/light/sample.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Words = py::array_t<u32, py::array::c_style | py::array::forcecast>;

template <class T>
T get(const py::dict& d, const char* key, T fallback) {
    return d.contains(key) ? d[key].cast<T>() : fallback;
}

Vec3 get_vec(const py::dict& d, const char* key, Vec3 fallback) {
    if (!d.contains(key)) return fallback;
    auto v = d[key].cast<std::vector<float>>();
    return {v.at(0), v.at(1), v.at(2)};
}

cpu::LampInput lamp_input(const py::dict& d) {
    static const std::vector<std::string> shapes{"POINT", "SPOT", "SUN", "SQUARE", "RECTANGLE", "DISK", "ELLIPSE"};
    cpu::LampInput in;
    auto shape = d["shape"].cast<std::string>();
    for (size_t i = 0; i < shapes.size(); ++i)
        if (shapes[i] == shape) in.shape = static_cast<cpu::LampShape>(i);
    auto matrix = d["matrix"].cast<std::vector<float>>();
    for (size_t i = 0; i < 12; ++i) in.matrix.m[i] = matrix.at(i);
    in.color = get_vec(d, "color", in.color);
    in.power = get(d, "power", in.power);
    in.normalize = get(d, "normalize", in.normalize);
    in.radius = get(d, "radius", in.radius);
    in.soft_falloff = get(d, "soft_falloff", in.soft_falloff);
    in.spot_size = get(d, "spot_size", in.spot_size);
    in.spot_blend = get(d, "spot_blend", in.spot_blend);
    in.angle = get(d, "angle", in.angle);
    in.size = get(d, "size", in.size);
    in.size_y = get(d, "size_y", in.size_y);
    in.spread = get(d, "spread", in.spread);
    in.visibility = get(d, "visibility", in.visibility);
    in.use_mis = get(d, "use_mis", in.use_mis);
    in.has_program = true;  // so that parametric coordinates are computed
    return in;
}

// One material per mesh, one mesh per instance row.
class TestLights {
 public:
    TestLights(const py::list& lamps, const py::list& meshes, const py::list& instances, const py::dict& world,
               bool light_tree, size_t most_triangles) {
        for (auto item : meshes) add_mesh(item.cast<py::dict>());
        for (auto item : instances) add_instance(item.cast<py::dict>());
        std::vector<cpu::LampInput> inputs;
        for (auto item : lamps) inputs.push_back(lamp_input(item.cast<py::dict>()));
        ObjectView object{};
        objects_.assign(1, object);
        scene_.positions = positions_.data();
        scene_.triangles = triangles_.data();
        scene_.material_slots = slots_.data();
        scene_.meshes = meshes_.data();
        scene_.instances = instances_.data();
        scene_.objects = objects_.data();
        scene_.material_table = table_.data();
        scene_.materials = materials_.data();
        scene_.mesh_count = static_cast<u32>(meshes_.size());
        scene_.instance_count = static_cast<u32>(instances_.size());
        cpu::ThreadPool pool(1);
        store_.build(scene_, inputs, world_input(world), estimates_, light_tree, pool, most_triangles);
        scene_.lights = &store_.view();
    }

    py::dict sample(const Floats& p, const Floats& n, bool transmits, const Floats& u) const {
        size_t count = static_cast<size_t>(p.shape(0));
        py::array_t<i32> kind(count);
        py::array_t<bool> delta(count), mis(count);
        Floats direction({count, size_t{3}}), radiance({count, size_t{3}}), normal({count, size_t{3}}),
            uv({count, size_t{2}});
        Floats distance(count), pdf(count);
        Words lamp(count), instance(count), prim(count);
        for (size_t i = 0; i < count; ++i) {
            const float* x = u.data() + 3 * i;
            LightSample s = sample_light(scene_, vec(p, i), vec(n, i), transmits, x[2], {x[0], x[1]});
            kind.mutable_data()[i] = static_cast<i32>(s.kind);
            delta.mutable_data()[i] = s.delta;
            mis.mutable_data()[i] = s.mis;
            store(s.direction, &direction, i);
            store(s.radiance, &radiance, i);
            store(s.normal, &normal, i);
            uv.mutable_data()[2 * i] = s.u;
            uv.mutable_data()[2 * i + 1] = s.v;
            distance.mutable_data()[i] = s.distance;
            pdf.mutable_data()[i] = s.pdf_sa;
            lamp.mutable_data()[i] = s.lamp;
            instance.mutable_data()[i] = s.instance;
            prim.mutable_data()[i] = s.prim;
        }
        py::dict r;
        r["kind"] = kind;
        r["delta"] = delta;
        r["mis"] = mis;
        r["direction"] = direction;
        r["radiance"] = radiance;
        r["normal"] = normal;
        r["uv"] = uv;
        r["distance"] = distance;
        r["pdf"] = pdf;
        r["lamp"] = lamp;
        r["instance"] = instance;
        r["prim"] = prim;
        return r;
    }

    Floats pdf_triangle(const Floats& p, const Floats& n, bool transmits, const Words& instance, const Words& prim,
                        const Floats& direction, const Floats& distance) const {
        size_t count = static_cast<size_t>(p.shape(0));
        Floats pdf(count);
        for (size_t i = 0; i < count; ++i)
            pdf.mutable_data()[i] = luch::pdf_triangle(scene_, vec(p, i), vec(n, i), transmits, instance.data()[i],
                                                       prim.data()[i], vec(direction, i), distance.data()[i]);
        return pdf;
    }

    Floats pdf_world(const Floats& p, const Floats& n, bool transmits, const Floats& direction) const {
        size_t count = static_cast<size_t>(p.shape(0));
        Floats pdf(count);
        for (size_t i = 0; i < count; ++i)
            pdf.mutable_data()[i] = luch::pdf_world(scene_, vec(p, i), vec(n, i), transmits, vec(direction, i));
        return pdf;
    }

    // sun >= 0: asks for that sun instead of the closest lamp.
    py::dict hit(const Floats& p, const Floats& n, bool transmits, const Floats& direction, u32 ray_kind,
                 int sun) const {
        size_t count = static_cast<size_t>(p.shape(0));
        Words lamp(count);
        Floats t(count), pdf(count), radiance({count, size_t{3}}), uv({count, size_t{2}}), normal({count, size_t{3}});
        for (size_t i = 0; i < count; ++i) {
            Ray ray{vec(p, i), 0.0f, vec(direction, i), INFINITE_DISTANCE};
            LampHit h = sun >= 0 ? sun_hit(scene_, static_cast<u32>(sun), ray.direction, ray_kind)
                                 : closest_lamp(scene_, ray, ray_kind);
            lamp.mutable_data()[i] = h.lamp;
            t.mutable_data()[i] = h.t;
            store(h.radiance, &radiance, i);
            store(h.normal, &normal, i);
            uv.mutable_data()[2 * i] = h.u;
            uv.mutable_data()[2 * i + 1] = h.v;
            pdf.mutable_data()[i] =
                h.lamp == NONE ? 0.0f : pdf_lamp(scene_, ray.origin, vec(n, i), transmits, h, ray.direction);
        }
        py::dict r;
        r["lamp"] = lamp;
        r["t"] = t;
        r["pdf"] = pdf;
        r["radiance"] = radiance;
        r["uv"] = uv;
        r["normal"] = normal;
        return r;
    }

    py::dict counts() const {
        const LightsView& v = store_.view();
        py::dict r;
        r["emitters"] = v.emitter_count;
        r["nodes"] = v.node_count;
        r["boxes"] = v.box_count;
        r["suns"] = v.sun_count;
        return r;
    }

 private:
    static Vec3 vec(const Floats& a, size_t i) { return {a.data()[3 * i], a.data()[3 * i + 1], a.data()[3 * i + 2]}; }
    static void store(Vec3 v, Floats* a, size_t i) {
        float* to = a->mutable_data() + 3 * i;
        to[0] = v.x;
        to[1] = v.y;
        to[2] = v.z;
    }

    void add_mesh(const py::dict& d) {
        auto positions = d["positions"].cast<Floats>();
        auto triangles = d["triangles"].cast<Words>();
        MeshView mesh{};
        mesh.first_vertex = static_cast<u32>(positions_.size() / 3);
        mesh.vertex_count = static_cast<u32>(positions.shape(0));
        mesh.first_triangle = static_cast<u32>(triangles_.size() / 3);
        mesh.triangle_count = static_cast<u32>(triangles.shape(0));
        positions_.insert(positions_.end(), positions.data(), positions.data() + positions.size());
        triangles_.insert(triangles_.end(), triangles.data(), triangles.data() + triangles.size());
        slots_.resize(triangles_.size() / 3, 0);
        meshes_.push_back(mesh);
        MaterialView material{};
        material.emission_sampling = get<u32>(d, "emission_sampling", 3u);
        material.program.flags = PROGRAM_EMISSION;
        table_.push_back(static_cast<u32>(materials_.size()));
        materials_.push_back(material);
        estimates_.push_back(get_vec(d, "emission", {1.0f, 1.0f, 1.0f}));
    }

    void add_instance(const py::dict& d) {
        InstanceView at{};
        auto matrix = d["matrix"].cast<std::vector<float>>();
        for (size_t i = 0; i < 12; ++i) at.to_world.m[i] = matrix.at(i);
        at.mesh = d["mesh"].cast<u32>();
        at.first_material = at.mesh;
        at.material_count = 1;
        at.visibility = RAY_ALL;
        at.flags = get<bool>(d, "mirrored", false) ? INSTANCE_MIRRORED : 0u;
        instances_.push_back(at);
    }

    cpu::WorldInput world_input(const py::dict& d) {
        cpu::WorldInput w;
        w.present = !d.empty();
        w.constant_radiance = get_vec(d, "radiance", {});
        w.has_sun = get(d, "has_sun", false);
        w.sun_direction = get_vec(d, "sun_direction", {0.0f, 0.0f, 1.0f});
        w.sun_angle = get(d, "sun_angle", 0.0f);
        w.sun_radiance = get_vec(d, "sun_radiance", {});
        if (d.contains("map")) {
            map_ = d["map"].cast<Floats>();
            w.constant = false;
            w.map_rgb = map_.data();
            w.map_width = static_cast<int>(map_.shape(1));
            w.map_height = static_cast<int>(map_.shape(0));
        }
        return w;
    }

    std::vector<float> positions_;
    std::vector<u32> triangles_, table_;
    std::vector<u16> slots_;
    std::vector<MeshView> meshes_;
    std::vector<InstanceView> instances_;
    std::vector<MaterialView> materials_;
    std::vector<ObjectView> objects_;
    std::vector<Color> estimates_;
    Floats map_;
    SceneView scene_{};
    cpu::LightStore store_;
};

}  // namespace

void bind_light(py::module_& m) {
    auto light = m.def_submodule("light", "Light sampling over arrays of points, for tests.");
    light.def("world_map_direction", [](int width, int height, int x, int y) {
        Vec3 d = cpu::world_map_direction(width, height, x, y);
        return py::make_tuple(d.x, d.y, d.z);
    });
    py::class_<TestLights>(light, "TestLights")
        .def(py::init<py::list, py::list, py::list, py::dict, bool, size_t>(), py::arg("lamps") = py::list(),
             py::arg("meshes") = py::list(), py::arg("instances") = py::list(), py::arg("world") = py::dict(),
             py::arg("light_tree") = true, py::arg("most_triangles") = size_t{cpu::LightStore::MOST_TRIANGLES})
        .def("sample", &TestLights::sample)
        .def("pdf_triangle", &TestLights::pdf_triangle)
        .def("pdf_world", &TestLights::pdf_world)
        .def("hit", &TestLights::hit, py::arg("p"), py::arg("n"), py::arg("transmits"), py::arg("direction"),
             py::arg("ray_kind") = static_cast<u32>(RAY_DIFFUSE), py::arg("sun") = -1)
        .def("counts", &TestLights::counts);
}

}  // namespace luch::bindings

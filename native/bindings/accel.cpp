// Triangles and rays as arrays: one mesh, no instances.
#include <pybind11/numpy.h>

#include <optional>
#include <stdexcept>
#include <string>

#include "bindings/bind.h"
#include "cpu/accel/accel.h"
#include "luch/geometry/surface.h"

namespace luch::bindings {
namespace {

using FloatArray = py::array_t<float, py::array::c_style>;
using IndexArray = py::array_t<u32, py::array::c_style>;
using ByteArray = py::array_t<u8, py::array::c_style>;
using cpu::Accel;

constexpr size_t RAYS_PER_CHUNK = 4096;
static_assert(sizeof(Ray) == 32);
constexpr Affine IDENTITY = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

class MeshAccel {
 public:
    MeshAccel(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags, bool brute_force,
              unsigned threads)
        : pool_(threads) {
        if (flags.size() != 0 && flags.size() != triangles.shape(0))
            throw py::value_error("flags must be empty or one per triangle.");
        MeshView mesh = {};
        mesh.vertex_count = u32(positions.shape(0));
        mesh.triangle_count = u32(triangles.shape(0));
        InstanceView instance = {};
        instance.to_world = instance.to_object = IDENTITY;
        instance.visibility = RAY_ALL;
        SceneView scene = {};
        scene.positions = positions.data();
        scene.triangles = triangles.data();
        scene.meshes = &mesh;
        scene.instances = &instance;
        scene.mesh_count = scene.instance_count = 1;
        std::vector<std::vector<u8>> mesh_flags = {{flags.data(), flags.data() + flags.size()}};
        py::gil_scoped_release release;
        accel_ =
            Accel::build(scene, mesh_flags, pool_, brute_force ? cpu::AccelKind::BRUTE_FORCE : cpu::AccelKind::BVH);
    }

    py::tuple closest(const FloatArray& rays) {
        py::ssize_t count = rays.shape(0);
        FloatArray t(count), u(count), v(count);
        py::array_t<i32> prim(count);
        float *t_out = t.mutable_data(), *u_out = u.mutable_data(), *v_out = v.mutable_data();
        i32* prim_out = prim.mutable_data();
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        {
            py::gil_scoped_release release;
            pool_.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
                std::vector<Hit> hits(end - begin);
                accel_->closest(in + begin, nullptr, hits.data(), end - begin);
                for (size_t i = begin; i < end; ++i) {
                    const Hit& hit = hits[i - begin];
                    t_out[i] = hit.t;
                    prim_out[i] = i32(hit.prim);  // NONE is -1
                    u_out[i] = hit.u;
                    v_out[i] = hit.v;
                }
            });
        }
        return py::make_tuple(t, prim, u, v);
    }

    py::array_t<u8> any(const FloatArray& rays) {
        py::ssize_t count = rays.shape(0);
        py::array_t<u8> blocked(count);
        u8* out = blocked.mutable_data();
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        py::gil_scoped_release release;
        pool_.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
            accel_->any(in + begin, nullptr, out + begin, end - begin);
        });
        return blocked;
    }

    py::dict stats() const {
        cpu::AccelStats s = accel_->stats();
        py::dict out;
        out["triangles"] = s.triangles;
        out["nodes"] = s.nodes;
        out["leaf_blocks"] = s.leaf_blocks;
        out["bytes"] = s.bytes;
        out["dropped_triangles"] = s.dropped_triangles;
        out["build_seconds"] = s.build_seconds;
        return out;
    }

 private:
    cpu::ThreadPool pool_;
    std::unique_ptr<Accel> accel_;
};

// Rays that leave points of triangles: corners (N, 9), barycentrics (N, 2), directions (N, 3) -> rays (N, 8).
FloatArray spawn_rays(const FloatArray& corners, const FloatArray& uv, const FloatArray& directions) {
    py::ssize_t count = corners.shape(0);
    FloatArray rays(std::vector<py::ssize_t>{count, 8});
    Ray* out = reinterpret_cast<Ray*>(rays.mutable_data());
    for (py::ssize_t i = 0; i < count; ++i) {
        const Vec3* p = reinterpret_cast<const Vec3*>(corners.data() + 9 * i);
        Vec3 d = *reinterpret_cast<const Vec3*>(directions.data() + 3 * i);
        SurfacePoint s = triangle_point(p[0], p[1], p[2], uv.data()[2 * i], uv.data()[2 * i + 1], IDENTITY, IDENTITY);
        Vec3 n = normalize_or(cross(p[1] - p[0], p[2] - p[0]), make_vec3(0.0f, 0.0f, 1.0f));
        out[i] = {offset_origin(s.p, s.error, n, d), 0.0f, d, INFINITE_DISTANCE};
    }
    return rays;
}

}  // namespace

void bind_accel(py::module_& m) {
    // Shapes and types are checked by luch/accel.py, which is the public face.
    py::class_<MeshAccel>(m, "MeshAccel")
        .def(py::init<const FloatArray&, const IndexArray&, const ByteArray&, bool, unsigned>())
        .def("closest", &MeshAccel::closest)
        .def("any", &MeshAccel::any)
        .def("stats", &MeshAccel::stats);
    m.def("spawn_rays", &spawn_rays, "Rays off triangles by their error bound, for tests of the bound.");
}

}  // namespace luch::bindings

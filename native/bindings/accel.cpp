// Triangles and rays as arrays: one mesh, no instances.
#include <pybind11/numpy.h>

#include <algorithm>
#include <mutex>
#include <vector>

#include "bindings/bind.h"
#include "bindings/counts.h"
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

// Meshes and instances as arrays, and rays through them. Shapes are checked in Python (luch/accel.py).
class ArrayAccel {
 public:
    // meshes: (M, 4) first vertex, vertices, first triangle, triangles. instance_meshes: (I,). to_world and
    // to_object: (I, 12). visibility: (I,) RayKind bits. flags: one per triangle, or none. kind: StructureKind; -1: the eight-wide tree.
    ArrayAccel(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
               const IndexArray& meshes, const IndexArray& instance_meshes, const FloatArray& to_world,
               const FloatArray& to_object, const IndexArray& visibility, int kind, u32 quality, u32 precision,
               unsigned threads, u64 flatten_triangles)
        : pool_(threads) {
        std::vector<MeshView> mesh_views(size_t(meshes.shape(0)), MeshView{});
        std::vector<std::vector<u8>> mesh_flags;
        for (size_t m = 0; m < mesh_views.size(); ++m) {
            const u32* row = meshes.data() + 4 * m;
            mesh_views[m].first_vertex = row[0];
            mesh_views[m].vertex_count = row[1];
            mesh_views[m].first_triangle = row[2];
            mesh_views[m].triangle_count = row[3];
            if (flags.size()) mesh_flags.emplace_back(flags.data() + row[2], flags.data() + row[2] + row[3]);
        }
        std::vector<InstanceView> instances(size_t(instance_meshes.shape(0)), InstanceView{});
        for (size_t i = 0; i < instances.size(); ++i) {
            instances[i].mesh = instance_meshes.data()[i];
            instances[i].visibility = visibility.data()[i];
            std::copy_n(to_world.data() + 12 * i, 12, instances[i].to_world.m);
            std::copy_n(to_object.data() + 12 * i, 12, instances[i].to_object.m);
        }
        SceneView scene = {};
        scene.positions = positions.data();
        scene.triangles = triangles.data();
        scene.meshes = mesh_views.data();
        scene.mesh_count = u32(mesh_views.size());
        scene.instances = instances.data();
        scene.instance_count = u32(instances.size());
        py::gil_scoped_release release;
        cpu::AccelChoice choice;
        choice.wide = kind < 0;
        if (!choice.wide) choice.kind = cpu::StructureKind(kind);
        choice.quality = cpu::BuildQuality(quality);
        choice.precision = Precision(precision);
        accel_ = Accel::build(scene, mesh_flags, pool_, choice, flatten_triangles);
    }

    // kinds: one RayKind mask per ray, or none.
    py::tuple closest(const FloatArray& rays, const IndexArray& kinds) {
        py::ssize_t count = rays.shape(0);
        FloatArray t(count), u(count), v(count);
        py::array_t<i32> prim(count), instance(count);
        float *t_out = t.mutable_data(), *u_out = u.mutable_data(), *v_out = v.mutable_data();
        i32 *prim_out = prim.mutable_data(), *instance_out = instance.mutable_data();
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        const u32* kind = kinds.size() ? kinds.data() : nullptr;
        {
            py::gil_scoped_release release;
            pool_.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
                std::vector<Hit> hits(end - begin);
                accel_->closest(in + begin, kind ? kind + begin : nullptr, hits.data(), end - begin);
                for (size_t i = begin; i < end; ++i) {
                    const Hit& hit = hits[i - begin];
                    t_out[i] = hit.t;
                    prim_out[i] = i32(hit.prim);  // NONE is -1
                    instance_out[i] = i32(hit.instance);
                    u_out[i] = hit.u;
                    v_out[i] = hit.v;
                }
            });
        }
        return py::make_tuple(t, prim, u, v, instance);
    }

    py::array_t<u8> any(const FloatArray& rays, const IndexArray& kinds) {
        py::ssize_t count = rays.shape(0);
        py::array_t<u8> blocked(count);
        u8* out = blocked.mutable_data();
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        const u32* kind = kinds.size() ? kinds.data() : nullptr;
        py::gil_scoped_release release;
        pool_.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
            accel_->any(in + begin, kind ? kind + begin : nullptr, out + begin, end - begin);
        });
        return blocked;
    }

    // The work of rays (N, 8), all together: nodes, boxes, primitives, bytes.
    py::dict count(const FloatArray& rays, bool any_hit) {
        const Ray* in = reinterpret_cast<const Ray*>(rays.data());
        Counters total;
        {
            std::mutex lock;
            py::gil_scoped_release release;
            pool_.parallel_for(size_t(rays.shape(0)), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
                std::vector<Hit> hits(end - begin);
                std::vector<u8> blocked(end - begin);
                Counters kept;
                if (any_hit)
                    accel_->any(in + begin, nullptr, blocked.data(), end - begin, &kept);
                else
                    accel_->closest(in + begin, nullptr, hits.data(), end - begin, &kept);
                std::lock_guard guard(lock);
                total.add(kept);
            });
        }
        return counts(total);
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
    py::class_<ArrayAccel>(m, "ArrayAccel")
        .def(py::init<const FloatArray&, const IndexArray&, const ByteArray&, const IndexArray&, const IndexArray&,
                      const FloatArray&, const FloatArray&, const IndexArray&, int, u32, u32, unsigned, u64>())
        .def("closest", &ArrayAccel::closest)
        .def("any", &ArrayAccel::any)
        .def("count", &ArrayAccel::count)
        .def("stats", &ArrayAccel::stats);
    m.def("spawn_rays", &spawn_rays, "Rays off triangles by their error bound, for tests of the bound.");
}

}  // namespace luch::bindings

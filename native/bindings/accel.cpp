// Triangles and rays as arrays: one mesh, no instances.
#include "cpu/accel/accel.h"

#include <mutex>

#include "bindings/array_scene.h"
#include "bindings/counts.h"
#include "luch/geometry/surface.h"

namespace luch::bindings {
namespace {

using cpu::Accel;

// Meshes and instances as arrays, and rays through them. Shapes are checked in Python (luch/accel.py).
class ArrayAccel {
 public:
    // kind: StructureKind; -1: the eight-wide tree. The rest: array_scene.h.
    ArrayAccel(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
               const IndexArray& meshes, const IndexArray& instance_meshes, const FloatArray& to_world,
               const FloatArray& to_object, const IndexArray& visibility, int kind, u32 quality, u32 precision,
               unsigned threads, u64 flatten_triangles, const FloatArray& spheres)
        : pool_(threads) {
        ArrayScene scene(positions, triangles, flags, meshes, instance_meshes, to_world, to_object, visibility,
                         spheres);
        py::gil_scoped_release release;
        accel_ = Accel::build(scene.view, scene.mesh_flags, pool_, accel_choice(kind, quality, precision),
                              flatten_triangles);
    }
    py::tuple closest(const FloatArray& rays, const IndexArray& kinds) {
        return closest_of(*accel_, pool_, rays, kinds);
    }
    py::array_t<u8> any(const FloatArray& rays, const IndexArray& kinds) { return any_of(*accel_, pool_, rays, kinds); }

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
                    accel_->any(in + begin, nullptr, blocked.data(), end - begin, nullptr, &kept);
                else
                    accel_->closest(in + begin, nullptr, hits.data(), end - begin, nullptr, &kept);
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
        out["spheres"] = s.spheres;
        out["nodes"] = s.nodes;
        out["leaf_blocks"] = s.leaf_blocks;
        out["bytes"] = s.bytes;
        out["dropped_triangles"] = s.dropped_triangles;
        out["duplicate_primitives"] = s.duplicates;
        out["dropped_spheres"] = s.dropped_spheres;
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
        Triangle triangle = {{p[0], p[1], p[2]}};
        TrianglePoint s = traced_point(triangle, uv.data()[2 * i], uv.data()[2 * i + 1]);
        Vec3 n = normalize_or(area_normal(triangle), make_vec3(0.0f, 0.0f, 1.0f));
        out[i] = {offset_origin(s.p, s.error, n, d), 0.0f, d, INFINITE_DISTANCE};
    }
    return rays;
}

}  // namespace

void bind_accel(py::module_& m) {
    py::class_<ArrayAccel>(m, "ArrayAccel")
        .def(py::init<const FloatArray&, const IndexArray&, const ByteArray&, const IndexArray&, const IndexArray&,
                      const FloatArray&, const FloatArray&, const IndexArray&, int, u32, u32, unsigned, u64,
                      const FloatArray&>())
        .def("closest", &ArrayAccel::closest)
        .def("any", &ArrayAccel::any)
        .def("count", &ArrayAccel::count)
        .def("stats", &ArrayAccel::stats);
    m.def("spawn_rays", &spawn_rays, "Rays off triangles by their error bound, for tests of the bound.");
}

}  // namespace luch::bindings

// Meshes and instances as arrays, for bindings of what is built over a scene. Shapes are checked in Python.
#pragma once
#include <pybind11/numpy.h>

#include <vector>

#include "bindings/bind.h"
#include "cpu/accel/accel.h"

namespace luch::bindings {

using FloatArray = py::array_t<float, py::array::c_style>;
using IndexArray = py::array_t<u32, py::array::c_style>;
using ByteArray = py::array_t<u8, py::array::c_style>;

// Borrows the arrays.
struct ArrayScene {
    // meshes: (M, 6) first vertex, vertices, first triangle, triangles, first sphere, spheres; or (M, 4) without the
    // last two. instance_meshes: (I,). to_world and to_object: (I, 12). visibility: (I,) RayKind bits. flags: one per
    // triangle, then perhaps one per sphere; or none. spheres: (S, 4) centre, radius.
    ArrayScene(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
               const IndexArray& meshes, const IndexArray& instance_meshes, const FloatArray& to_world,
               const FloatArray& to_object, const IndexArray& visibility, const FloatArray& spheres);

    std::vector<MeshView> meshes;
    std::vector<InstanceView> instances;
    std::vector<std::vector<u8>> mesh_flags;
    SceneView view = {};
};

// kind: StructureKind; -1: the eight-wide tree of the CPU.
cpu::AccelChoice accel_choice(int kind, u32 quality, u32 precision);

inline constexpr size_t RAYS_PER_CHUNK = 4096;
static_assert(sizeof(Ray) == 32);

// Hits (t, prim, u, v, instance) and Blocked values of rays (N, 8); kinds: one RayKind mask a ray, or none. Tracer: with
// closest and any as cpu::Accel has them.
template <class Tracer>
py::tuple closest_of(const Tracer& tracer, cpu::ThreadPool& pool, const FloatArray& rays, const IndexArray& kinds) {
    py::ssize_t count = rays.shape(0);
    FloatArray t(count), u(count), v(count);
    py::array_t<i32> prim(count), instance(count);
    float *t_out = t.mutable_data(), *u_out = u.mutable_data(), *v_out = v.mutable_data();
    i32 *prim_out = prim.mutable_data(), *instance_out = instance.mutable_data();
    const Ray* in = reinterpret_cast<const Ray*>(rays.data());
    const u32* kind = kinds.size() ? kinds.data() : nullptr;
    {
        py::gil_scoped_release release;
        pool.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
            std::vector<Hit> hits(end - begin);
            tracer.closest(in + begin, kind ? kind + begin : nullptr, hits.data(), end - begin);
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

template <class Tracer>
py::array_t<u8> any_of(const Tracer& tracer, cpu::ThreadPool& pool, const FloatArray& rays, const IndexArray& kinds) {
    py::ssize_t count = rays.shape(0);
    py::array_t<u8> blocked(count);
    u8* out = blocked.mutable_data();
    const Ray* in = reinterpret_cast<const Ray*>(rays.data());
    const u32* kind = kinds.size() ? kinds.data() : nullptr;
    py::gil_scoped_release release;
    pool.parallel_for(size_t(count), RAYS_PER_CHUNK, [&](size_t begin, size_t end, unsigned) {
        tracer.any(in + begin, kind ? kind + begin : nullptr, out + begin, end - begin);
    });
    return blocked;
}

}  // namespace luch::bindings

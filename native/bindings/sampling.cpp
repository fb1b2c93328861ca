// Sampler and warps over arrays, for tests and tools.
#include "luch/sampling/sampler.h"

#include <vector>

#include "bindings/bind.h"
#include "luch/sampling/warp.h"

namespace luch::bindings {
namespace {

using Indices = py::array_t<u32, py::array::c_style | py::array::forcecast>;
using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

// Samples of one dimension: indices (N,) -> float32 (N, channels).
template <int CHANNELS, typename Draw>
Floats draw_all(u32 seed, const Indices& indices, Draw draw) {
    py::ssize_t n = indices.size();
    Floats out({n, py::ssize_t{CHANNELS}});
    const u32* index = indices.data();
    float* to = out.mutable_data();
    py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < n; ++i) draw(Sampler{seed, index[i]}, to + i * CHANNELS);
    return out;
}

// Applies a warp of the unit square row by row: u (N, 2) -> (N, channels).
template <int CHANNELS, typename Warp>
Floats warp_all(const Floats& u, Warp warp) {
    if (u.ndim() != 2 || u.shape(1) != 2) throw py::value_error("u must have shape (N, 2)");
    py::ssize_t n = u.shape(0);
    Floats out({n, py::ssize_t{CHANNELS}});
    for (py::ssize_t i = 0; i < n; ++i) {
        auto v = warp(Vec2{u.data()[2 * i], u.data()[2 * i + 1]});
        float* to = out.mutable_data() + i * CHANNELS;
        to[0] = v.x;
        to[1] = v.y;
        if constexpr (CHANNELS == 3) to[2] = v.z;
    }
    return out;
}

void bind_warps(py::module_& m) {
    m.def("sample_disk", [](const Floats& u) { return warp_all<2>(u, [](Vec2 v) { return sample_disk(v); }); });
    m.def("sample_polygon", [](float corners, float rotation, const Floats& u) {
        return warp_all<2>(u, [=](Vec2 v) { return sample_polygon(corners, rotation, v); });
    });
    m.def("sample_triangle", [](const Floats& u) { return warp_all<2>(u, [](Vec2 v) { return sample_triangle(v); }); });
    m.def("sample_cosine_hemisphere",
          [](const Floats& u) { return warp_all<3>(u, [](Vec2 v) { return sample_cosine_hemisphere(v); }); });
    m.def("sample_uniform_hemisphere",
          [](const Floats& u) { return warp_all<3>(u, [](Vec2 v) { return sample_uniform_hemisphere(v); }); });
    m.def("sample_uniform_sphere",
          [](const Floats& u) { return warp_all<3>(u, [](Vec2 v) { return sample_uniform_sphere(v); }); });
    m.def("sample_cone", [](float one_minus_cos, const Floats& u) {
        return warp_all<3>(u, [=](Vec2 v) { return sample_cone(one_minus_cos, v); });
    });
}

}  // namespace

void bind_sampling(py::module_& m) {
    auto sampling = m.def_submodule("sampling", "Owen-scrambled Sobol points and warps of the unit square.");
    sampling.def("sample_1d", [](u32 seed, const Indices& index, u32 dimension) {
        return draw_all<1>(seed, index, [=](const Sampler& s, float* to) { *to = sample_1d(s, dimension); });
    });
    sampling.def("sample_2d", [](u32 seed, const Indices& index, u32 dimension) {
        return draw_all<2>(seed, index, [=](const Sampler& s, float* to) {
            Vec2 v = sample_2d(s, dimension);
            to[0] = v.x, to[1] = v.y;
        });
    });
    sampling.def("sample_3d", [](u32 seed, const Indices& index, u32 dimension) {
        return draw_all<3>(seed, index, [=](const Sampler& s, float* to) {
            Vec3 v = sample_3d(s, dimension);
            to[0] = v.x, to[1] = v.y, to[2] = v.z;
        });
    });
    sampling.def(
        "pixel_sampler",
        [](u32 x, u32 y, u32 seed, u32 log2_samples) {
            PixelSampler p = make_pixel_sampler(x, y, seed, log2_samples);
            return py::make_tuple(p.seed, p.first_index);
        },
        "(seed, first index) of a pixel's samples.");
    bind_warps(sampling);
}

}  // namespace luch::bindings

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

// family: SamplerFamily, whatever the dimension's highest bits say.
template <int CHANNELS, typename Draw>
void bind_draw(py::module_& m, const char* name, Draw draw) {
    m.def(
        name,
        [=](u32 seed, const Indices& index, u32 dimension, u32 family) {
            Floats out;
            with_family(SamplerFamily(family), [&](auto tag) {
                out =
                    draw_all<CHANNELS>(seed, index, [=](const Sampler& s, float* to) { draw(tag, s, dimension, to); });
            });
            return out;
        },
        py::arg("seed"), py::arg("index"), py::arg("dimension"), py::arg("family") = 0u);
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
    auto sampling = m.def_submodule("sampling", "Families of points and warps of the unit square.");
    bind_draw<1>(sampling, "sample_1d", [](auto family, const Sampler& s, u32 dimension, float* to) {
        *to = sample_1d_of<family.VALUE>(s, dimension);
    });
    bind_draw<2>(sampling, "sample_2d", [](auto family, const Sampler& s, u32 dimension, float* to) {
        Vec2 v = sample_2d_of<family.VALUE>(s, dimension);
        to[0] = v.x, to[1] = v.y;
    });
    bind_draw<3>(sampling, "sample_3d", [](auto family, const Sampler& s, u32 dimension, float* to) {
        Vec3 v = sample_3d_of<family.VALUE>(s, dimension);
        to[0] = v.x, to[1] = v.y, to[2] = v.z;
    });
    sampling.def(
        "sample_any",
        [](u32 seed, const Indices& index, u32 dimension) {
            return draw_all<3>(seed, index, [=](const Sampler& s, float* to) {
                Vec3 v = sample_3d(s, dimension);
                Vec2 two = sample_2d(s, dimension);
                bool same = two.x == v.x && two.y == v.y && sample_1d(s, dimension) == v.x;
                to[0] = same ? v.x : -1.0f, to[1] = v.y, to[2] = v.z;
            });
        },
        "As paths draw: the dimension's two highest bits say the family. x is -1 where fewer coordinates differ.");
    sampling.def(
        "pixel_sampler",
        [](u32 x, u32 y, u32 seed, u32 log2_samples, u32 family) {
            PixelSampler p = make_pixel_sampler(x, y, seed, log2_samples, SamplerFamily(family));
            return py::make_tuple(p.seed, p.first_index);
        },
        py::arg("x"), py::arg("y"), py::arg("seed"), py::arg("log2_samples"), py::arg("family") = 0u,
        "(seed, first index) of a pixel's samples.");
    bind_warps(sampling);
}

}  // namespace luch::bindings

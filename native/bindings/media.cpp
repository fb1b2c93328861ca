// Phase functions over arrays, for tests.
#include "cpu/volume/media.h"

#include "bindings/bind.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

// A medium of one phase function, as a scene has it.
struct OneLobe {
    cpu::MediaStore store;
    MediaView view;

    OneLobe(const std::string& kind, float a, float b) {
        store.set_world(store.add({{}, {}, {{kind, {1.0f, 1.0f, 1.0f}, a, b}}}));
        CameraView camera{};
        view = store.view(SceneView{}, camera, 1.0f, 1.0f);
    }
};

Vec3 row(const Floats& array, py::ssize_t i) {
    const float* p = array.data() + 3 * i;
    return {p[0], p[1], p[2]};
}

void check(const Floats& directions, py::ssize_t channels) {
    if (directions.ndim() != 2 || directions.shape(1) != channels)
        throw py::value_error("directions must be (N, 3), random numbers (N, 2)");
}

// Density per steradian of going on in directions after (N, 3), unit, having come in direction +z: float32 (N,).
Floats phase_density(const std::string& kind, float a, float b, const Floats& after) {
    check(after, 3);
    OneLobe lobe(kind, a, b);
    Floats out(after.shape(0));
    for (py::ssize_t i = 0; i < out.size(); ++i)
        eval_media_phase(lobe.view, MediumStack{}, {0.0f, 0.0f, 1.0f}, row(after, i), out.mutable_data() + i);
    return out;
}

// Directions after one of +z: float32 (N, 3), by random numbers u (N, 2).
Floats sample_phases(const std::string& kind, float a, float b, const Floats& u) {
    check(u, 2);
    OneLobe lobe(kind, a, b);
    Floats out({u.shape(0), py::ssize_t{3}});
    for (py::ssize_t i = 0; i < u.shape(0); ++i) {
        Vec3 w = sample_media_phase(lobe.view, MediumStack{}, {0.0f, 0.0f, 1.0f},
                                    {u.data()[2 * i], u.data()[2 * i + 1], 0.5f});
        float* to = out.mutable_data() + 3 * i;
        to[0] = w.x, to[1] = w.y, to[2] = w.z;
    }
    return out;
}

}  // namespace

void bind_media(py::module_& m) {
    auto media = m.def_submodule("media", "Phase functions of volumes.");
    media.def("phase_density", &phase_density, py::arg("kind"), py::arg("a"), py::arg("b"), py::arg("after"));
    media.def("sample_phase", &sample_phases, py::arg("kind"), py::arg("a"), py::arg("b"), py::arg("u"));
}

}  // namespace luch::bindings

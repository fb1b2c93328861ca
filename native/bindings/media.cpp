// Phase functions over arrays, and the numbers that walks and flights draw, for tests.
#include "cpu/volume/media.h"

#include "bindings/bind.h"
#include "luch/integrator/flight_light.h"
#include "luch/integrator/subsurface_disk.h"

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

// One of the densities on a line that walks and flights draw from, and its samples. a, b, c:
//   WALK         cosine of the angle to the last direction; a: anisotropy
//   GUIDED       cosine of the angle to the normal; a: albedo
//   PROFILE      distance along a surface; a: length
//   FLIGHT       distance; a: extinction, b: reach
//   EQUIANGULAR  distance; a: foot of the light's perpendicular, b: reach, c: distance of the light from the ray
struct Line {
    std::string kind;
    float a, b, c;

    FlightDensity flight() const {
        FlightDensity d{};
        d.weights = {1.0f, 0.0f, 0.0f};
        d.extinction = {a, 1.0f, 1.0f};
        d.length_inverse = {1.0f / transmitted_length(a, b), 0.0f, 0.0f};
        return d;
    }
    Equiangular equiangular() const {
        Ray ray{{0.0f, 0.0f, 0.0f}, 0.0f, {0.0f, 0.0f, 1.0f}, b};
        return make_equiangular(ray, b, {c, 0.0f, a});
    }
    float density(float x) const {
        if (kind == "WALK") return TWO_PI * henyey_greenstein(x, a);
        if (kind == "GUIDED") return TWO_PI * guided_pdf(guide_of(a), x);
        if (kind == "PROFILE") return profile(a, x);
        if (kind == "FLIGHT") return flight_density(flight(), x);
        if (kind == "EQUIANGULAR") return equiangular_density(equiangular(), x);
        throw py::value_error("There is no density " + kind);
    }
    float sample(float u) const {
        if (kind == "WALK") return sample_henyey_greenstein(a, u);
        if (kind == "GUIDED") return sample_guided(guide_of(a), u);
        if (kind == "PROFILE") return sample_profile(u) * a;
        if (kind == "FLIGHT") return sample_flight_density(flight(), b, 0.0f, u);
        if (kind == "EQUIANGULAR") return sample_equiangular(equiangular(), u);
        throw py::value_error("There is no density " + kind);
    }
};

// One function of Line over numbers (N,): float32 (N,).
template <class F>
void bind_line(py::module_& m, const char* name, const char* of, F function) {
    m.def(
        name,
        [=](const std::string& kind, float a, float b, float c, const Floats& numbers) {
            Line line{kind, a, b, c};
            Floats out(numbers.size());
            for (py::ssize_t i = 0; i < numbers.size(); ++i) out.mutable_data()[i] = function(line, numbers.data()[i]);
            return out;
        },
        py::arg("kind"), py::arg("a"), py::arg("b"), py::arg("c"), py::arg(of));
}

}  // namespace

void bind_media(py::module_& m) {
    auto media = m.def_submodule("media", "Phase functions of volumes.");
    media.def("phase_density", &phase_density, py::arg("kind"), py::arg("a"), py::arg("b"), py::arg("after"));
    media.def("sample_phase", &sample_phases, py::arg("kind"), py::arg("a"), py::arg("b"), py::arg("u"));
    bind_line(media, "line_density", "x", [](const Line& line, float x) { return line.density(x); });
    bind_line(media, "sample_line", "u", [](const Line& line, float u) { return line.sample(u); });
}

}  // namespace luch::bindings

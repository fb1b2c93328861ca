// Elementary functions over arrays, for tests of their accuracy and speed.
#include <cmath>

#include "bindings/bind.h"
#include "luch/math/fn.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

// The plain loop that shader operations use: it must vectorise by itself.
template <float (*FUNCTION)(float)>
Floats map_one(const Floats& x) {
    Floats out(x.size());
    const float* __restrict from = x.data();
    float* __restrict to = out.mutable_data();
    py::ssize_t n = x.size();
    for (py::ssize_t i = 0; i < n; ++i) to[i] = FUNCTION(from[i]);
    return out;
}

template <float (*FUNCTION)(float, float)>
Floats map_two(const Floats& x, const Floats& y) {
    if (x.size() != y.size()) throw py::value_error("arrays of equal length expected");
    Floats out(x.size());
    const float* __restrict a = x.data();
    const float* __restrict b = y.data();
    float* __restrict to = out.mutable_data();
    py::ssize_t n = x.size();
    for (py::ssize_t i = 0; i < n; ++i) to[i] = FUNCTION(a[i], b[i]);
    return out;
}

float libm_sin(float x) { return std::sin(x); }
float libm_pow(float x, float y) { return std::pow(x, y); }

}  // namespace

void bind_math(py::module_& m) {
    auto math = m.def_submodule("math", "Elementary functions over float32 arrays.");
    math.def("sin", &map_one<sin_f>);
    math.def("cos", &map_one<cos_f>);
    math.def("tan", &map_one<tan_f>);
    math.def("asin", &map_one<asin_f>);
    math.def("acos", &map_one<acos_f>);
    math.def("atan", &map_one<atan_f>);
    math.def("atan2", &map_two<atan2_f>);
    math.def("exp", &map_one<exp_f>);
    math.def("exp2", &map_one<exp2_f>);
    math.def("log", &map_one<log_f>);
    math.def("log2", &map_one<log2_f>);
    math.def("pow", &map_two<pow_f>);
    math.def("fmod", &map_two<fmod_f>);
    math.def("libm_sin", &map_one<libm_sin>, "The C library's, for comparing speed.");
    math.def("libm_pow", &map_two<libm_pow>, "The C library's, for comparing speed.");
}

}  // namespace luch::bindings

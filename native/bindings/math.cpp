// Elementary functions, for tests of their accuracy.
#include <pybind11/numpy.h>

#include "bindings/bind.h"
#include "luch/math/fn.h"

namespace luch::bindings {

void bind_math(py::module_& m) {
    auto math = m.def_submodule("math", "Elementary functions over float32 arrays.");
    math.def("sin", py::vectorize([](float x) { return sin_f(x); }));
    math.def("cos", py::vectorize([](float x) { return cos_f(x); }));
    math.def("exp", py::vectorize([](float x) { return exp_f(x); }));
    math.def("log", py::vectorize([](float x) { return log_f(x); }));
    math.def("pow", py::vectorize([](float x, float y) { return pow_f(x, y); }));
}

}  // namespace luch::bindings

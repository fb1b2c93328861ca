// The triangle tests one by one, for comparing them. Shapes are the caller's duty: tests/native/test_triangle_tests.py.
#include "luch/geometry/triangle_tests.h"

#include <pybind11/numpy.h>

#include <string>

#include "bindings/bind.h"

namespace luch::bindings {
namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;

bool run_test(const std::string& name, const Ray& ray, Vec3 p0, Vec3 p1, Vec3 p2, TriangleHit* hit) {
    if (name == "plane")
        return intersect_triangle_plane(ray.origin, ray.direction, p0, p1, p2, ray.t_min, ray.t_max, hit);
    if (name == "barycentric")
        return intersect_triangle_barycentric(ray.origin, ray.direction, p0, p1, p2, ray.t_min, ray.t_max, hit);
    if (name == "double")
        return intersect_triangle_double(ray.origin, ray.direction, p0, p1, p2, ray.t_min, ray.t_max, hit);
    if (name == "watertight")
        return intersect_triangle(make_triangle_ray(ray.origin, ray.direction), p0, p1, p2, ray.t_min, ray.t_max, hit);
    throw py::value_error("No triangle test is called '" + name + "'.");
}

// rays (N, 8), corners (N, 9): ray i against triangle i. Returns (N, 3): t (infinite on a miss), u, v.
FloatArray test_triangles(const std::string& name, const FloatArray& rays, const FloatArray& corners) {
    if (rays.ndim() != 2 || rays.shape(1) != 8 || corners.ndim() != 2 || corners.shape(1) != 9 ||
        rays.shape(0) != corners.shape(0))
        throw py::value_error("rays must be (N, 8) and corners (N, 9).");
    FloatArray out({rays.shape(0), py::ssize_t(3)});
    const Ray* ray = reinterpret_cast<const Ray*>(rays.data());
    const float* p = corners.data();
    float* to = out.mutable_data();
    for (py::ssize_t i = 0; i < rays.shape(0); ++i, p += 9, to += 3) {
        TriangleHit hit = {INFINITE_DISTANCE, 0.0f, 0.0f};
        run_test(name, ray[i], {p[0], p[1], p[2]}, {p[3], p[4], p[5]}, {p[6], p[7], p[8]}, &hit);
        to[0] = hit.t;
        to[1] = hit.u;
        to[2] = hit.v;
    }
    return out;
}

}  // namespace

void bind_triangle_tests(py::module_& m) { m.def("test_triangles", &test_triangles); }

}  // namespace luch::bindings

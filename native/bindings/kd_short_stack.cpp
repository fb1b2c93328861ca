// The kd-tree walked with a short stack, which only kernels choose: for comparing it with the full one.
#include <pybind11/numpy.h>

#include "bindings/bind.h"
#include "luch/accel/kd_tree.h"

namespace luch::bindings {
namespace {

using FloatArray = py::array_t<float, py::array::c_style>;
using IndexArray = py::array_t<u32, py::array::c_style>;

// nodes (N, 2) and refs as ArrayStructure.device_arrays gives them, box (6,), corners (T, 9), valid rays (R, 8).
// Returns (R, 3): t (infinite on a miss), u, v; and refs (R,).
py::tuple closest_with_short_stack(const IndexArray& nodes, const IndexArray& refs, const FloatArray& box,
                                   const FloatArray& corners, const FloatArray& rays) {
    const float* b = box.data();
    KdTree tree = {
        reinterpret_cast<const KdNode*>(nodes.data()), refs.data(), {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}};
    Primitives all = {corners.data(), nullptr, nullptr, u32(corners.shape(0)), 0, {}};
    FloatArray out({rays.shape(0), py::ssize_t(3)});
    IndexArray found(rays.shape(0));
    const Ray* ray = reinterpret_cast<const Ray*>(rays.data());
    NoCounters none;
    for (py::ssize_t i = 0; i < rays.shape(0); ++i) {
        RefHit hit = {ray[i].t_max, NONE, 0.0f, 0.0f};
        closest_hit<Precision::WATERTIGHT, KdShortStack<2>>(tree, all, ray[i], &hit, none);
        float* to = out.mutable_data() + 3 * i;
        to[0] = hit.ref == NONE ? INFINITE_DISTANCE : hit.t;
        to[1] = hit.u;
        to[2] = hit.v;
        found.mutable_data()[i] = hit.ref;
    }
    return py::make_tuple(out, found);
}

}  // namespace

void bind_kd_short_stack(py::module_& m) { m.def("closest_with_short_stack", &closest_with_short_stack); }

}  // namespace luch::bindings

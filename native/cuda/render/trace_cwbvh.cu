#include "render/trace_plan.cuh"

#include "luch/accel/cwbvh.h"
#define LUCH_VIEW luch::Cwbvh
#include "render/trace_one.cuh"
#include "render/trace_scene.cuh"

#define LUCH_PERSISTENT_TRACE_KERNEL(name) \
    extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK, LUCH_BLOCKS) name

LUCH_PERSISTENT_TRACE_KERNEL(trace_closest)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_persistent<luch::SceneWalker<luch::Precision::LUCH_PRECISION, false>>(luch::SceneRays{scene, task});
}
LUCH_PERSISTENT_TRACE_KERNEL(trace_any)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_persistent<luch::SceneWalker<luch::Precision::LUCH_PRECISION, true>>(luch::SceneRays{scene, task});
}
LUCH_PERSISTENT_TRACE_KERNEL(trace_closest_one)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_persistent<luch::Walker<luch::Precision::LUCH_PRECISION, false>>(luch::OneGroupRays{scene, task});
}
LUCH_PERSISTENT_TRACE_KERNEL(trace_any_one)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_persistent<luch::Walker<luch::Precision::LUCH_PRECISION, true>>(luch::OneGroupRays{scene, task});
}
LUCH_TRACE_KERNEL(trace_closest_simple)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_closest_simple<luch::Precision::LUCH_PRECISION>(scene, task);
}
LUCH_TRACE_KERNEL(trace_any_simple)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_any_simple<luch::Precision::LUCH_PRECISION>(scene, task);
}

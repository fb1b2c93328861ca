// One thread a ray through the scene's trees, by the functions that the CPU runs. The .cu file that includes this
// includes the structure's header and names LUCH_VIEW before it; the compiler's -D names LUCH_PRECISION.
#pragma once
#include "render/trace.cuh"

LUCH_TRACE_KERNEL(trace_closest)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_closest_simple<luch::Precision::LUCH_PRECISION>(scene, task);
}
LUCH_TRACE_KERNEL(trace_any)(LUCH_TRACE_ARGUMENTS) {
    luch::trace_any_simple<luch::Precision::LUCH_PRECISION>(scene, task);
}

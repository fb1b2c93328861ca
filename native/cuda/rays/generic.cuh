// The kernels of any structure: one thread a ray. The .cu file that includes this includes the view's header and names
// LUCH_VIEW before it; the compiler's -D names LUCH_PRECISION.
#pragma once
#include "rays/structure.cuh"

LUCH_KERNEL(closest)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(closest_counted)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}
LUCH_KERNEL(any)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(any_counted)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}

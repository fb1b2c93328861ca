// The kernels of any structure: one thread a ray. The unit that includes this names LUCH_VIEW (the view struct),
// LUCH_PRECISION (a Precision) and the view's header before it.
#pragma once
#include "rays/structure.cuh"

LUCH_KERNEL(closest)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(closest_counted)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, LUCH_PRECISION, luch::Counters>(view, all, batch);
}
LUCH_KERNEL(any)(LUCH_ARGUMENTS) { luch::trace_any<LUCH_VIEW, LUCH_PRECISION, luch::NoCounters>(view, all, batch); }
LUCH_KERNEL(any_counted)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, LUCH_PRECISION, luch::Counters>(view, all, batch);
}

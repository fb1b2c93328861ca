// The kernels of the compressed wide tree: persistent ones, and those of any structure under other names.
#pragma once
#include "rays/persistent.cuh"

#define LUCH_PERSISTENT_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK, LUCH_BLOCKS) name

LUCH_PERSISTENT_KERNEL(closest)(LUCH_ARGUMENTS) {
    luch::trace_persistent<luch::Precision::LUCH_PRECISION, false>(view, batch);
}
LUCH_PERSISTENT_KERNEL(any)(LUCH_ARGUMENTS) {
    luch::trace_persistent<luch::Precision::LUCH_PRECISION, true>(view, batch);
}
LUCH_KERNEL(closest_simple)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(any_simple)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
LUCH_KERNEL(closest_counted)(LUCH_ARGUMENTS) {
    luch::trace_closest<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}
LUCH_KERNEL(any_counted)(LUCH_ARGUMENTS) {
    luch::trace_any<LUCH_VIEW, luch::Precision::LUCH_PRECISION, luch::Counters>(view, all, batch);
}

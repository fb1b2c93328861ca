// One thread a ray through the scene's trees, by the functions that the CPU runs. The .cu file that includes this
// includes the structure's header and names LUCH_VIEW before it; the compiler's -D names LUCH_PRECISION.
#pragma once
#include "render/trace.cuh"

LUCH_TRACE_KERNEL(trace_closest)(LUCH_TRACE_ARGUMENTS) {
    luch::for_each_ray(task, [&](luch::u32 i) {
        task.hits[i] =
            luch::closest_hit<luch::Precision::LUCH_PRECISION>(scene, luch::ray_of(task, i), luch::kinds_of(task, i));
    });
}
LUCH_TRACE_KERNEL(trace_any)(LUCH_TRACE_ARGUMENTS) {
    luch::for_each_ray(task, [&](luch::u32 i) {
        task.blocked[i] =
            luch::any_hit<luch::Precision::LUCH_PRECISION>(scene, luch::ray_of(task, i), luch::kinds_of(task, i));
    });
}

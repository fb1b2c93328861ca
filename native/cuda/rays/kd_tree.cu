// `closest_full` has room for every node that can wait, for the race.
#include "rays/kd_tree.cuh"

#define LUCH_RESIDENT_BLOCKS 8  // 64 registers a thread
#define LUCH_VIEW luch::ShortStackKdTree
#include "rays/generic.cuh"

LUCH_KERNEL(closest_full)(LUCH_ARGUMENTS) {
    luch::trace_closest<luch::KdTree, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}

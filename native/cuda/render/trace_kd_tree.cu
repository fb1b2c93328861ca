#include "render/trace_plan.cuh"

#include "rays/kd_tree.cuh"
#define LUCH_VIEW luch::ShortStackKdTree
#include "render/trace_generic.cuh"

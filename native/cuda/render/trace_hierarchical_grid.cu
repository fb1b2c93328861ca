#include "render/trace_plan.cuh"

#include "luch/accel/hierarchical_grid.h"
#define LUCH_VIEW luch::HierarchicalGrid
#include "render/trace_generic.cuh"

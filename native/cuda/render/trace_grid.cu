#include "render/trace_plan.cuh"

#include "luch/accel/grid.h"
#define LUCH_VIEW luch::Grid
#include "render/trace_generic.cuh"

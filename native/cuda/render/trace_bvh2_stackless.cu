#include "render/trace_plan.cuh"

#include "luch/accel/bvh2_stackless.h"
#define LUCH_VIEW luch::Bvh2Stackless
#include "render/trace_generic.cuh"

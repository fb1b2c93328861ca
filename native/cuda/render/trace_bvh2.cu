#include "render/trace_plan.cuh"

#include "luch/accel/bvh2.h"
#define LUCH_VIEW luch::Bvh2
#include "render/trace_generic.cuh"

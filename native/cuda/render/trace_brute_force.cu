#include "render/trace_plan.cuh"

#include "luch/accel/brute_force.h"
#define LUCH_VIEW luch::BruteForce
#include "render/trace_generic.cuh"

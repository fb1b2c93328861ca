#include "luch/accel/cwbvh.h"
#define LUCH_VIEW luch::Cwbvh
#include "render/trace_generic.cuh"
#include "render/trace_one.cuh"

#include "luch/accel/bvh2_stackless.h"
#define LUCH_VIEW luch::Bvh2Stackless
#include "rays/stackless.cuh"

#include "luch/accel/kd_tree.h"
#define LUCH_VIEW luch::KdTree
#include "render/trace_generic.cuh"

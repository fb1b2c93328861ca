#include "luch/accel/kd_tree.h"
#define LUCH_VIEW luch::KdTree
#include "rays/generic.cuh"

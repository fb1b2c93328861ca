#include "luch/accel/cwbvh.h"
#define LUCH_VIEW luch::Cwbvh
#include "rays/cwbvh.cuh"

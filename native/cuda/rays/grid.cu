#include "luch/accel/grid.h"
#define LUCH_VIEW luch::Grid
#include "rays/generic.cuh"

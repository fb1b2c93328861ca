#include "luch/accel/brute_force.h"
#define LUCH_VIEW luch::BruteForce
#include "rays/brute_force.cuh"

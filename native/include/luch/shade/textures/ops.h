// Every texture operation; the closed list is ops.inc beside this file.
#pragma once
#include "luch/shade/textures/gabor.h"
#include "luch/shade/textures/noise.h"
#include "luch/shade/textures/patterns.h"
#include "luch/shade/textures/voronoi.h"

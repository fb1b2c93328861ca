// Every texture operation; the closed list is ops.inc beside this file.
#pragma once
#include "luch/shade/textures/gabor.h"
#include "luch/shade/textures/ies.h"
#include "luch/shade/textures/image_nodes.h"
#include "luch/shade/textures/noise.h"
#include "luch/shade/textures/patterns.h"
#include "luch/shade/textures/radial_tiling.h"
#include "luch/shade/textures/sky.h"
#include "luch/shade/textures/spectral.h"
#include "luch/shade/textures/voronoi.h"

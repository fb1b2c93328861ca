// Phase functions that have no handy inverse, as tables (luch/bsdf/phase.h). In double, once per lobe of a scene.
#pragma once
#include <vector>

#include "luch/bsdf/phase.h"

namespace luch::cpu {

// Draine 2003, "Scattering by Interstellar Dust Grains. I": Rayleigh at g = 0, alpha = 1. g in (-1, 1): the table is
// that of |g|. 3 * PHASE_KNOTS floats.
std::vector<float> draine_table(double g, double alpha);

// Fournier and Forand 1994, Fournier and Jonasz 1999: particles in water of a refractive index and a slope of sizes,
// the latter by the share of light that is scattered back (Mobley et al. 2002). Taken within 1.01 to 2 and 1e-4 to 0.4999.
std::vector<float> fournier_forand_table(double refractive_index, double backscatter);

}  // namespace luch::cpu

// Tables that find_interval of light/world.h chooses by.
#pragma once
#include <cstddef>
#include <vector>

namespace luch::cpu {

// Rises from exactly 0 to exactly 1, one entry more than masses.
inline void fill_cdf(const std::vector<double>& masses, float* cdf) {
    double total = 0.0, running = 0.0;
    for (double m : masses) total += m;
    cdf[0] = 0.0f;
    for (std::size_t i = 0; i < masses.size(); ++i) {
        running += masses[i];
        cdf[i + 1] = total > 0.0 ? static_cast<float>(running / total)
                                 : static_cast<float>(i + 1) / static_cast<float>(masses.size());
    }
    cdf[masses.size()] = 1.0f;
}

}  // namespace luch::cpu

#pragma once
#include <string>

#include "luch/film/filter.h"

namespace luch::cpu {

// kind: "BOX" (one pixel wide whatever the width), "GAUSSIAN", "BLACKMAN_HARRIS"; width in pixels as
// Blender's Filter Width. Throws std::invalid_argument for any other kind.
PixelFilter make_pixel_filter(const std::string& kind, double width);

}  // namespace luch::cpu

// How long a path may go on without anything that its limits count: the borders of volumes are no surfaces.
#pragma once
#include "luch/integrator/path.h"

namespace luch {

// As many as Cycles lets a path pass. More are met only where a ray meets one border again and again, because numbers
// have no digits left there (an object stretched to 1e7 m).
inline constexpr u32 MOST_BORDERS = 1024;

// Rounds after which a path cannot live but for borders: a round is one bounce, one transparent surface or one border.
LUCH_FN u32 most_rounds(const PathLimits& limits) { return limits.bounces + limits.transparent + MOST_BORDERS; }

}  // namespace luch

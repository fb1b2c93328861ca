// How exactly rays and primitives are compared: one choice, the same names everywhere.
#pragma once
#include "luch/platform.h"

namespace luch {

enum class Precision : u32 {
    FAST = 0,        // single precision, plain slabs: a ray along an edge may slip between two triangles
    WATERTIGHT = 1,  // exact signs of the edge functions, conservative boxes: none does (triangle.h, bounds.h)
    DOUBLE = 2,      // vertices and rays are taken to double first: t, u, v to the last bit of single precision
};

}  // namespace luch

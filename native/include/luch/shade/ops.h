// Every operation a shader program can name. A new one is a struct in a header of shade/nodes/ (or
// shade/textures/) and one line in the closed list ops.inc.
#pragma once
#include "luch/shade/nodes/closures.h"
#include "luch/shade/nodes/color.h"
#include "luch/shade/nodes/curves.h"
#include "luch/shade/nodes/hair.h"
#include "luch/shade/nodes/map_range.h"
#include "luch/shade/nodes/math.h"
#include "luch/shade/nodes/normals.h"
#include "luch/shade/nodes/point.h"
#include "luch/shade/op.h"
#if __has_include("luch/shade/textures/ops.h")
#include "luch/shade/textures/ops.h"
#endif

namespace luch {

enum class OpCode : u16 {
#define LUCH_OP(NAME, STRUCT) NAME,
#include "luch/shade/ops.inc"
#undef LUCH_OP
    COUNT
};

}  // namespace luch

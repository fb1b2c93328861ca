// Shader programs on the device. A scene's own build includes straight-line code that luch/cuda/programs.py wrote;
// without it programs are interpreted, operation by operation, by the same functions. run_program: all of a material's;
// run_surface_light: emission, transparency and holdout alone; run_light_program: the same of the world, of lamps and of
// surfaces whose emission is not the same everywhere. Kernels hold no code of programs that they never run.
#pragma once
#include "luch/bsdf/bsdf.h"
#include "luch/shade/ops.h"

namespace luch {

#define LUCH_OP(NAME, STRUCT) using OP_##NAME = STRUCT;
#include "luch/shade/ops.inc"
#undef LUCH_OP

// Long operations stand apart, once in a kernel, however many programs use them.
template <class Op>
__device__ __noinline__ void op_apart(const OpContext& c, const u32* params, const float* in, float* out) {
    Op::eval(c, params, in, out);
}

}  // namespace luch

#ifdef LUCH_SCENE_PROGRAMS
#include "luch_scene_programs.cuh"
#else
#include "render/interpreter.cuh"
#endif

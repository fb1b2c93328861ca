// Any program, one operation after the other: what renders until the scene's own kernels are compiled.
#pragma once
#include "luch/shade/ops.h"

namespace luch {

// Registers of a program's interpreter, in local memory; luch/cuda/scene_kernels.py refuses a general kernel for more.
inline constexpr u32 INTERPRETER_REGISTERS = 256;

template <class Op>
__device__ __noinline__ void run_op(const OpContext& c, const u32* operands, float* registers) {
    constexpr int outputs = Op::outputs, inputs = Op::inputs;
    float in[inputs > 0 ? inputs : 1], out[outputs > 0 ? outputs : 1];
    for (int k = 0; k < inputs; k++) in[k] = registers[operands[outputs + k]];
    Op::eval(c, operands + outputs + inputs, in, out);
    for (int k = 0; k < outputs; k++) registers[operands[k]] = out[k];
}

__device__ __noinline__ void run_instructions(const OpContext& c, u32 count) {
    float registers[INTERPRETER_REGISTERS];
    const SceneView& scene = *c.scene;
    const Program& program = *c.program;
    for (u32 k = 0; k < program.constant_count; k++) registers[k] = scene.constants[program.first_constant + k];
    const Instruction* instruction = scene.instructions + program.first_instruction;
    for (u32 k = 0; k < count; k++, instruction++) {
        const u32* operands = scene.operands + instruction->operands;
        switch (OpCode(instruction->op)) {
#define LUCH_OP(NAME, STRUCT)                   \
    case OpCode::NAME:                          \
        run_op<STRUCT>(c, operands, registers); \
        break;
#include "luch/shade/ops.inc"
#undef LUCH_OP
            default:
                break;
        }
    }
}

__device__ __forceinline__ void run_program(const OpContext& c) { run_instructions(c, c.program->instruction_count); }

__device__ __forceinline__ void run_light_program(const OpContext& c) {
    run_instructions(c, c.program->light_instruction_count);
}

__device__ __forceinline__ void run_surface_light(const OpContext& c) { run_light_program(c); }

}  // namespace luch

"""A scene's shader programs as CUDA source: straight-line code that calls the functions of luch/shade.

Constants and static words stay in memory, so that a colour can change without a compiler; programs that differ in
nothing else share their code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from luch.shader_code import OPS, OpInfo

INSTRUCTION = np.dtype([("op", "<u2"), ("params", "<u2"), ("operands", "<u4")])  # Instruction of shade/op.h
BY_CODE = {info.code: info for info in OPS.values()}
# Operations of a few instructions, better pasted in than called. The rest stands once in a kernel.
PASTED = frozenset(
    "MATH_ADD MATH_SUBTRACT MATH_MULTIPLY MATH_MULTIPLY_ADD MATH_ABSOLUTE MATH_MINIMUM MATH_MAXIMUM MATH_LESS_THAN "
    "MATH_GREATER_THAN MATH_CLAMP MATH_MIX MATH_SATURATE VECTOR_DOT_PRODUCT COLOR_LUMINANCE BLEND_MIX POINT_POSITION "
    "POINT_NORMAL POINT_TRUE_NORMAL POINT_INCOMING POINT_BACKFACING POINT_PARAMETRIC LIGHT_PATH_FLAG "
    "LIGHT_PATH_LENGTH CLOSURE_EMISSION CLOSURE_TRANSPARENT CLOSURE_HOLDOUT".split()
)


@dataclass(frozen=True)
class Linked:
    """A program within the scene's arrays: the fields of Program (shade/op.h) that its code depends on."""

    first_instruction: int
    instruction_count: int
    light_instruction_count: int
    register_count: int
    first_constant: int
    constant_count: int


def _statement(info: OpInfo, words: list[int], param_count: int, offset: int) -> str:
    """One operation; offset: of its operands from the program's first."""
    outputs, inputs = words[: info.outputs], words[info.outputs : info.outputs + info.inputs]
    params = words[info.outputs + info.inputs : info.outputs + info.inputs + param_count]
    lines = []
    if inputs:
        lines.append(f"const float in[] = {{{', '.join(f'r{k}' for k in inputs)}}};")
    if outputs:
        lines.append(f"float out[{len(outputs)}];")
    read, written = "in" if inputs else "nullptr", "out" if outputs else "nullptr"
    if info.name in PASTED:
        if params:
            lines.append(f"const u32 params[] = {{{', '.join(f'{p}u' for p in params)}}};")
        lines.append(f"OP_{info.name}::eval(c, {'params' if params else 'nullptr'}, {read}, {written});")
    else:
        at = f"operands + {offset + len(outputs) + len(inputs)}" if params else "nullptr"
        lines.append(f"op_apart<OP_{info.name}>(c, {at}, {read}, {written});")
    lines += [f"r{register} = out[{k}];" for k, register in enumerate(outputs)]
    return "    { " + " ".join(lines) + " }"


def _body(program: Linked, count: int, instructions: Any, operands: Any) -> str:
    """The first `count` operations."""
    own = instructions[program.first_instruction : program.first_instruction + count]
    base = int(own[0]["operands"])
    statements, used = [], set()
    for op, param_count, at in own.tolist():
        info = BY_CODE[op]
        words = operands[at : at + info.outputs + info.inputs + param_count].tolist()
        used.update(words[: info.outputs + info.inputs])
        statements.append(_statement(info, words, param_count, at - base))
    lines = [
        "    const u32* operands = c.scene->operands + c.scene->instructions[c.program->first_instruction].operands;"
        if any("operands +" in s for s in statements)
        else "",
        "    const float* constants = c.scene->constants + c.program->first_constant;"
        if any(k < program.constant_count for k in used)
        else "",
    ]
    lines += [f"    float r{k}{f' = constants[{k}]' if k < program.constant_count else ''};" for k in sorted(used)]
    return "\n".join([line for line in lines if line] + statements)


def operations(programs: list[Linked], instructions: Any) -> set[str]:
    """Names of all that the programs hold."""
    codes: set[int] = set()
    for program in programs:
        own = instructions[program.first_instruction : program.first_instruction + program.instruction_count]
        codes.update(own["op"].tolist())
    return {BY_CODE[code].name for code in codes}


def source(programs: list[Linked], materials: int, instructions: Any, operands: Any) -> str:
    """luch_scene_programs.cuh: functions that run exactly these programs, each with no more than may be asked of it.

    programs: those of materials, so many, before those of the world and of lamps, of which nobody asks more than light.
    instructions: INSTRUCTION (I,); operands: uint32 (O,): SceneView's arrays.
    """
    bodies: dict[str, int] = {}

    def runner(name: str, some: list[Linked], counted: str, otherwise: str = "break") -> list[str]:
        called: dict[int, int] = {}
        for program in some:
            if count := getattr(program, counted):
                body = _body(program, count, instructions, operands)
                called[program.first_instruction] = bodies.setdefault(body, len(bodies))
        return [
            f"__device__ __forceinline__ void {name}(const OpContext& c) {{",
            f"    if (c.program->{counted} == 0u) return;",
            "    switch (c.program->first_instruction) {",
            *(f"        case {first}u: straight_{number}(c); break;" for first, number in called.items()),
            f"        default: {otherwise};",
            "    }",
            "}",
        ]

    surfaces, lights = programs[:materials], programs[materials:]
    functions = [
        *runner("run_program", surfaces, "instruction_count"),
        *runner("run_surface_light", surfaces, "light_instruction_count"),
        *runner("run_light_program", lights, "light_instruction_count",
                "if constexpr (plan::EMISSION_PROGRAMS) run_surface_light(c)"),
    ]  # fmt: skip
    parts = ["#pragma once", '#include "render/programs.cuh"', "namespace luch {"]
    for body, number in bodies.items():
        parts.append(f"__device__ __noinline__ void straight_{number}(const OpContext& c) {{\n{body}\n}}")
    return "\n".join([*parts, *functions, "}  // namespace luch"]) + "\n"

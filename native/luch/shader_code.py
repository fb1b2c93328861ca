"""What a shader program is made of, and how a list of operations becomes one: order, registers, flags."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NewType

import numpy as np

from luch._native import core
from luch.scene import F32, U32

Value = NewType("Value", int)
Vector = tuple[Value, Value, Value]

# ProgramFlag of shade/op.h
EMISSION = 1
TRANSPARENT = 2
SURFACE = 4
CONSTANT_EMISSION = 8
LIGHT_PATH = 16
HOLDOUT = 32
EMISSION_FRONT = 64
EMISSION_BACK = 128
EMISSION_BY_SIDE = 4096
SUBSURFACE = 256
SUBSURFACE_BUMP = 512

# AttributeSlot of shade/op.h: defaults of the mesh
ATTRIBUTE_UV = 0xFFFFFFF0
ATTRIBUTE_COLOR = 0xFFFFFFF1
ATTRIBUTE_GENERATED = 0xFFFFFFF2
ATTRIBUTE_TANGENT = 0xFFFFFFF3

# Closures that light needs (emission, shadows); their operations come first in the program.
_LIGHT_CLOSURES = ("CLOSURE_EMISSION", "CLOSURE_TRANSPARENT", "CLOSURE_HOLDOUT")
_BACKFACING = "POINT_BACKFACING"
PRINCIPLED = ("CLOSURE_PRINCIPLED", "CLOSURE_PRINCIPLED_SUBSURFACE")
# Closures that scatter light under the surface -> where among their inputs the radius and the normal begin.
_SUBSURFACE = {"CLOSURE_SUBSURFACE": (6, 12), "CLOSURE_PRINCIPLED_SUBSURFACE": (3, 14)}


@dataclass(frozen=True)
class OpInfo:
    """One line of the native operation table."""

    name: str
    code: int
    inputs: int
    outputs: int
    params: int
    closure: bool
    constant: bool  # depends on inputs, params and tables alone


OPS: dict[str, OpInfo] = {row["name"]: OpInfo(**row) for row in core.shade.op_table()}


@dataclass(frozen=True)
class Node:
    """One operation of the program; ``first`` is its first output value."""

    op: OpInfo
    inputs: tuple[Value, ...]
    params: tuple[int, ...]
    first: int


def float_word(x: float) -> int:
    """The 32 bits of a float, as a static word. Beyond the range of float32 it is infinite."""
    try:
        return int(struct.unpack("<I", struct.pack("<f", x))[0])
    except OverflowError:
        return float_word(math.copysign(math.inf, x))


def word_float(bits: int) -> float:
    """The float of a static word."""
    return float(struct.unpack("<f", struct.pack("<I", bits))[0])


def constant_emission(closures: Sequence[Node], constant_of: Mapping[int, float]) -> tuple[float, float, float] | None:
    """Summed emission if it is the same everywhere, else None."""
    total = np.zeros(3)
    for node in closures:
        if node.op.name == "CLOSURE_EMISSION":
            known = [constant_of.get(value) for value in node.inputs[:3]]
            if None in known:
                return None
            total += [number for number in known if number is not None]
        elif emits(node):  # attenuated by its coat
            return None
    return float(total[0]), float(total[1]), float(total[2])


def run_constant(op: OpInfo, numbers: Sequence[float], params: Sequence[int], tables: F32) -> list[float]:
    """Outputs of an operation whose inputs are known, by the native code itself."""
    count = len(numbers) + op.outputs
    registers = [*range(len(numbers), count), *range(len(numbers))]
    code = np.array([op.code, len(params), *registers, *params], np.uint32)
    result = core.shade.run_program(code, np.array(numbers, np.float32), count, tables, 1)["registers"]
    return [float(result[len(numbers) + k, 0]) for k in range(op.outputs)]


def schedule(closures: Sequence[Node], made_by: Mapping[int, Node]) -> list[Node]:
    """Every operation that a closure needs, once, before its first use; light's closures first."""
    order: list[Node] = []
    done: set[int] = set()
    roots = sorted(closures, key=lambda node: not (node.op.name in _LIGHT_CLOSURES or emits(node)))
    for root in roots:
        stack: list[tuple[Node, bool]] = [(root, False)]
        while stack:
            node, ready = stack.pop()
            if id(node) in done:
                continue
            if ready:
                done.add(id(node))
                order.append(node)
                continue
            stack.append((node, True))
            parents = [made_by[value] for value in node.inputs if value in made_by]
            stack.extend((parent, False) for parent in reversed(parents) if id(parent) not in done)
    return order


def encode(order: Sequence[Node], constant_of: Mapping[int, float]) -> tuple[U32, F32, int]:
    """Words, constants and register count. A register is free again after its value's last use (linear scan)."""
    last_use: dict[int, int] = {}
    for at, node in enumerate(order):
        for value in node.inputs:
            last_use[value] = at
    used = [value for value in constant_of if value in last_use]
    register = {value: k for k, value in enumerate(used)}
    constants = np.array([constant_of[value] for value in used], np.float32)
    count, free, code = len(used), list[int](), list[int]()
    for at, node in enumerate(order):
        ending = {v for v in node.inputs if last_use[v] == at and v not in constant_of}
        read = [register[value] for value in node.inputs]
        free.extend(sorted({register[value] for value in ending}, reverse=True))
        written, unused = [], []
        for output in range(node.first, node.first + node.op.outputs):
            if not free:
                free.append(count)
                count += 1
            register[output] = free.pop()
            written.append(register[output])
            if output not in last_use:
                unused.append(register[output])
        free.extend(unused)
        code.extend([node.op.code, len(node.params), *written, *read, *node.params])
    return np.array(code, np.uint32), constants, count


def program_flags(order: Sequence[Node], constant_of: Mapping[int, float], tables: F32) -> int:
    """ProgramFlag of a program of these operations."""
    flags = 0
    for node in order:
        name = node.op.name
        if name == "CLOSURE_EMISSION":
            flags |= EMISSION
        elif name == "CLOSURE_TRANSPARENT":
            flags |= TRANSPARENT
        elif name == "CLOSURE_HOLDOUT":
            flags |= HOLDOUT
        elif name.startswith("CLOSURE_"):
            flags |= SURFACE
            if name in PRINCIPLED:  # params: bump correction, multiscatter, emits, lets through
                flags |= (EMISSION if node.params[2] else 0) | (TRANSPARENT if node.params[3] else 0)
            if name in _SUBSURFACE:
                walks, bent = (
                    any(constant_of.get(value) != 0.0 for value in node.inputs[first : first + 3])
                    for first in _SUBSURFACE[name]
                )
                flags |= (SUBSURFACE | (SUBSURFACE_BUMP if bent else 0)) if walks else 0
        elif name.startswith("LIGHT_PATH"):
            flags |= LIGHT_PATH
    if flags & EMISSION:
        if constant_emission(order, constant_of) is not None:
            flags |= CONSTANT_EMISSION
        else:
            behind, before = (_emission_when(order, side, constant_of, tables) for side in (1.0, 0.0))
            flags |= EMISSION_FRONT if behind is not None and not any(behind) else 0
            flags |= EMISSION_BACK if before is not None and not any(before) else 0
            flags |= EMISSION_BY_SIDE if behind is not None and before is not None else 0
    return flags


def _emission_when(
    order: Sequence[Node], backfacing: float, constant_of: Mapping[int, float], tables: F32
) -> list[float] | None:
    """Weights of the emission closures if all are known when Geometry > Backfacing has the given value."""
    if not any(node.op.name == _BACKFACING for node in order):
        return None
    known, weights = dict(constant_of), list[float]()
    for node in order:
        if emits(node):
            return None
        numbers = [known.get(value) for value in node.inputs]
        if node.op.name == "CLOSURE_EMISSION":
            told = [number for number in numbers[:3] if number is not None]
            if len(told) < 3:
                return None
            weights += told
        if node.op.closure:
            continue
        if node.op.name == _BACKFACING:
            known[node.first] = backfacing
        elif node.op.name == "MATH_MULTIPLY" and 0.0 in numbers:
            known[node.first] = 0.0
        elif node.op.constant and None not in numbers:
            outputs = run_constant(node.op, [number for number in numbers if number is not None], node.params, tables)
            known.update({node.first + k: number for k, number in enumerate(outputs)})
    return weights


def emits(node: Node) -> bool:
    """Whether a Principled closure carries its emission itself (see OpClosurePrincipled)."""
    return node.op.name in PRINCIPLED and bool(node.params[2])

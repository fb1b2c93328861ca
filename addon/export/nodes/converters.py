"""Converter nodes: Math, Map Range, Clamp, Color Ramp, Float Curve, Separate and Combine, Mix of numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from luch.shader import Value, float_word

from .tree import Compiler, Outputs, emitter

TABLE_SIZE = 256  # samples of a ramp or curve, as in Cycles

# How many inputs each mode of Math reads; the operation is called MATH_ and the mode's name.
MATH_INPUTS = {
    **dict.fromkeys(
        [
            "SQRT",
            "INVERSE_SQRT",
            "ABSOLUTE",
            "EXPONENT",
            "SIGN",
            "ROUND",
            "FLOOR",
            "CEIL",
            "TRUNC",
            "FRACT",
            "SINE",
            "COSINE",
            "TANGENT",
            "ARCSINE",
            "ARCCOSINE",
            "ARCTANGENT",
            "SINH",
            "COSH",
            "TANH",
            "RADIANS",
            "DEGREES",
        ],
        1,
    ),
    **dict.fromkeys(
        [
            "ADD",
            "SUBTRACT",
            "MULTIPLY",
            "DIVIDE",
            "POWER",
            "LOGARITHM",
            "MINIMUM",
            "MAXIMUM",
            "LESS_THAN",
            "GREATER_THAN",
            "MODULO",
            "FLOORED_MODULO",
            "SNAP",
            "PINGPONG",
            "ARCTAN2",
        ],
        2,
    ),
    **dict.fromkeys(["MULTIPLY_ADD", "COMPARE", "SMOOTH_MIN", "SMOOTH_MAX", "WRAP"], 3),
}


@emitter("ShaderNodeMath")
def math(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Math, in every mode."""
    names = ("Value", "Value_001", "Value_002")[: MATH_INPUTS[node.operation]]
    result = c.builder.op1(f"MATH_{node.operation}", [c.float(node, name) for name in names])
    return {"Value": c.builder.op1("MATH_SATURATE", (result,)) if node.use_clamp else result}


@emitter("ShaderNodeMapRange")
def map_range(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Map Range of numbers or of vectors."""
    b, name = c.builder, f"MAP_RANGE_{node.interpolation_type}"
    stepped = node.interpolation_type == "STEPPED"
    if node.data_type == "FLOAT":
        sockets = ["Value", "From Min", "From Max", "To Min", "To Max", *(["Steps"] if stepped else [])]
        inputs = [c.float(node, socket) for socket in sockets]
        result = b.op1(name, inputs, (0,))
        return {"Result": _between(c, result, inputs[3], inputs[4]) if node.clamp else result}
    suffixes = ["From_Min", "From_Max", "To_Min", "To_Max", *(["Steps"] if stepped else [])]
    vectors = [c.vector(node, "Vector"), *(c.vector(node, f"{suffix}_FLOAT3") for suffix in suffixes)]
    parts = b.each(name, *vectors, params=(1,))
    if node.clamp:
        x, y, z = (_between(c, parts[k], vectors[3][k], vectors[4][k]) for k in range(3))
        parts = (x, y, z)
    return {"Vector": parts}


def _between(c: Compiler, value: Value, a: Value, b: Value) -> Value:
    """Clamps between two ends, whichever is the lower."""
    low, high = c.builder.op1("MATH_MINIMUM", (a, b)), c.builder.op1("MATH_MAXIMUM", (a, b))
    return c.builder.op1("MATH_CLAMP", (value, low, high))


@emitter("ShaderNodeClamp")
def clamp(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Clamp; the range mode puts its ends in order."""
    value, low, high = (c.float(node, name) for name in ("Value", "Min", "Max"))
    if node.clamp_type == "RANGE":
        return {"Result": _between(c, value, low, high)}
    return {"Result": c.builder.op1("MATH_CLAMP", (value, low, high))}


@emitter("ShaderNodeValToRGB")
def color_ramp(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Color Ramp, sampled as Cycles samples it."""
    ramp = node.color_ramp
    table = np.array([ramp.evaluate(k / (TABLE_SIZE - 1)) for k in range(TABLE_SIZE)], np.float32)
    params = (c.builder.table(table), TABLE_SIZE, int(ramp.interpolation == "CONSTANT"))
    red, green, blue, alpha = c.builder.op("COLOR_RAMP", (c.float(node, "Fac"),), params)
    return {"Color": (red, green, blue), "Alpha": alpha}


def curve_table(mapping: Any, count: int, combined: bool) -> tuple[np.ndarray, float, float]:
    """Samples of the first `count` curves, float32 (TABLE_SIZE, count), and where they begin and end.

    combined: the fourth curve of an RGB mapping is applied before each of the others.
    """
    mapping.update()
    curves = list(mapping.curves)[: count + int(combined)]
    first = min(curve.points[0].location[0] for curve in curves)
    last = max(curve.points[len(curve.points) - 1].location[0] for curve in curves)
    evaluate: Callable[[Any, float], float] = mapping.evaluate
    table = np.empty((TABLE_SIZE, count), np.float32)
    for k in range(TABLE_SIZE):
        x = first + k / (TABLE_SIZE - 1) * (last - first)
        inner = evaluate(curves[3], x) if combined else x
        table[k] = [evaluate(curve, inner) for curve in curves[:count]]
    return table, first, last


def apply_curves(c: Compiler, mapping: Any, values: tuple[Value, ...], factor: Value, combined: bool) -> list[Value]:
    """Each value through its own curve, blended in by factor."""
    table, first, last = curve_table(mapping, len(values), combined)
    offset, extrapolate = c.builder.table(table), int(mapping.extend == "EXTRAPOLATED")
    ends = (float_word(first), float_word(last))
    count = len(values)
    return [
        c.builder.op1("CURVE", (value, factor), (offset, TABLE_SIZE, count, k, extrapolate, *ends))
        for k, value in enumerate(values)
    ]


@emitter("ShaderNodeFloatCurve")
def float_curve(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Float Curve."""
    values = (c.float(node, "Value"),)
    return {"Value": apply_curves(c, node.mapping, values, c.float(node, "Factor"), combined=False)[0]}


@emitter("ShaderNodeSeparateXYZ")
def separate_xyz(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Separate XYZ: no operation at all."""
    x, y, z = c.vector(node, "Vector")
    return {"X": x, "Y": y, "Z": z}


@emitter("ShaderNodeCombineXYZ")
def combine_xyz(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Combine XYZ: no operation at all."""
    return {"Vector": (c.float(node, "X"), c.float(node, "Y"), c.float(node, "Z"))}


@emitter("ShaderNodeSeparateColor")
def separate_color(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Separate Color into RGB, HSV or HSL."""
    color = c.color(node, "Color")
    if node.mode != "RGB":
        color = c.builder.op3(f"RGB_TO_{node.mode}", color)
    return dict(zip(("Red", "Green", "Blue"), color, strict=True))


@emitter("ShaderNodeCombineColor")
def combine_color(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Combine Color from RGB, HSV or HSL."""
    parts = (c.float(node, "Red"), c.float(node, "Green"), c.float(node, "Blue"))
    return {"Color": parts if node.mode == "RGB" else c.builder.op3(f"{node.mode}_TO_RGB", parts)}


@emitter("ShaderNodeSqueeze")
def squeeze(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Squeeze: 1 / (1 + e^(-(value - centre) width)), a node of old files."""
    b = c.builder
    value, width, center = (c.float(node, name) for name in ("Value", "Width", "Center"))
    power = b.multiply(b.op1("MATH_SUBTRACT", (value, center)), width)
    scale = b.op1("MATH_POWER", (b.constant(2.71828183), b.op1("MATH_SUBTRACT", (b.constant(0.0), power))))
    return {"Value": b.op1("MATH_DIVIDE", (b.constant(1.0), b.op1("MATH_ADD", (b.constant(1.0), scale))))}

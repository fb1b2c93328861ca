"""Colour nodes: Mix, curves, adjustments."""

from __future__ import annotations

import bpy
from luch.shader import Value, Vector

from .converters import apply_curves
from .tree import Compiler, Output, Outputs, emitter

# Blend modes that go towards the result of a Math operation.
_TOWARDS = {
    "ADD": "MATH_ADD",
    "SUBTRACT": "MATH_SUBTRACT",
    "MULTIPLY": "MATH_MULTIPLY",
    "DARKEN": "MATH_MINIMUM",
    "LIGHTEN": "MATH_MAXIMUM",
}
_COMPONENTWISE = ("DIVIDE", "SCREEN", "OVERLAY", "DODGE", "BURN", "SOFT_LIGHT", "LINEAR_LIGHT", "EXCLUSION")


def blend(c: Compiler, mode: str, factor: Value, first: Vector, second: Vector) -> Vector:
    """Two colours mixed in one of Blender's blend modes."""
    b = c.builder
    spread = (factor, factor, factor)
    if mode == "MIX":
        return b.each("BLEND_MIX", first, second, spread)
    if mode in _TOWARDS:
        return b.each("BLEND_MIX", first, b.each(_TOWARDS[mode], first, second), spread)
    if mode == "DIFFERENCE":
        apart = b.each("MATH_ABSOLUTE", b.each("MATH_SUBTRACT", first, second))
        return b.each("BLEND_MIX", first, apart, spread)
    if mode in _COMPONENTWISE:
        return b.each(f"BLEND_{mode}", first, second, spread)
    return b.op3(f"BLEND_{mode}", (*first, *second, factor))


def _saturate(c: Compiler, vector: Vector) -> Vector:
    return c.builder.each("MATH_SATURATE", vector)


@emitter("ShaderNodeMix")
def mix(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Mix of numbers, vectors (one factor or three) and colours."""
    b = c.builder
    kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color", "ROTATION": "Rotation"}[node.data_type]
    result: Output
    if kind == "Vector" and node.factor_mode == "NON_UNIFORM":
        factors = c.vector(node, "Factor_Vector")
        factors = _saturate(c, factors) if node.clamp_factor else factors
        return {"Result_Vector": b.each("MATH_MIX", c.vector(node, "A_Vector"), c.vector(node, "B_Vector"), factors)}
    factor = c.float(node, "Factor_Float")
    if node.clamp_factor:
        factor = b.op1("MATH_SATURATE", (factor,))
    if kind == "Float":
        return {"Result_Float": b.op1("MATH_MIX", (c.float(node, "A_Float"), c.float(node, "B_Float"), factor))}
    first, second = c.vector(node, f"A_{kind}"), c.vector(node, f"B_{kind}")
    if kind == "Color":
        result = blend(c, node.blend_type, factor, first, second)
        return {"Result_Color": _saturate(c, result) if node.clamp_result else result}
    return {f"Result_{kind}": b.each("MATH_MIX", first, second, (factor, factor, factor))}


@emitter("ShaderNodeMixRGB")
def mix_rgb(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Mix Color of old files."""
    factor = c.builder.op1("MATH_SATURATE", (c.float(node, "Fac"),))
    color = blend(c, node.blend_type, factor, c.color(node, "Color1"), c.color(node, "Color2"))
    return {"Color": _saturate(c, color) if node.use_clamp else color}


@emitter("ShaderNodeRGBCurve")
def rgb_curves(c: Compiler, node: bpy.types.Node) -> Outputs:
    """RGB Curves: the combined curve, then each channel's."""
    x, y, z = apply_curves(c, node.mapping, c.color(node, "Color"), c.float(node, "Fac"), combined=True)
    return {"Color": (x, y, z)}


@emitter("ShaderNodeInvert")
def invert(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Invert Color."""
    factor = c.float(node, "Fac")
    return {"Color": c.builder.each("COLOR_INVERT", c.color(node, "Color"), (factor, factor, factor))}


@emitter("ShaderNodeHueSaturation")
def hue_saturation(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Hue/Saturation/Value."""
    settings = [c.float(node, name) for name in ("Hue", "Saturation", "Value", "Fac")]
    return {"Color": c.builder.op3("HUE_SATURATION", (*settings, *c.color(node, "Color")))}


@emitter("ShaderNodeBrightContrast")
def bright_contrast(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Brightness/Contrast."""
    bright, contrast = c.float(node, "Bright"), c.float(node, "Contrast")
    color = c.color(node, "Color")
    return {"Color": c.builder.each("COLOR_BRIGHT_CONTRAST", color, (bright,) * 3, (contrast,) * 3)}


@emitter("ShaderNodeGamma")
def gamma(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Gamma; negative components stay."""
    exponent = c.float(node, "Gamma")
    return {"Color": c.builder.each("COLOR_GAMMA", c.color(node, "Color"), (exponent, exponent, exponent))}


@emitter("ShaderNodeRGBToBW")
def rgb_to_bw(c: Compiler, node: bpy.types.Node) -> Outputs:
    """RGB to BW: luminance."""
    return {"Val": c.luminance(c.color(node, "Color"))}

"""Closure nodes: what a surface does with light. Each is given the weight it carries in the tree."""

from __future__ import annotations

import bpy
from luch.shader import Vector

from .tree import Compiler, closure_emitter


@closure_emitter("ShaderNodeEmission", "ShaderNodeBackground")
def emission(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Emission and Background: colour x strength."""
    radiance = c.builder.scale(c.color(node, "Color"), c.float(node, "Strength"))
    c.builder.closure("CLOSURE_EMISSION", c.builder.modulate(weight, radiance))


@closure_emitter("ShaderNodeBsdfTransparent")
def transparent(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Transparent: lets light pass straight on."""
    c.builder.closure("CLOSURE_TRANSPARENT", c.builder.modulate(weight, c.color(node, "Color")))


@closure_emitter("ShaderNodeHoldout")
def holdout(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Holdout: a hole in the picture."""
    c.builder.closure("CLOSURE_HOLDOUT", weight)


@closure_emitter("ShaderNodeMixShader")
def mix_shader(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Mix Shader: 1 - Fac of the first, Fac of the second."""
    b = c.builder
    factor = b.op1("MATH_SATURATE", (c.float(node, "Fac"),))
    rest = b.op1("MATH_SUBTRACT", (b.constant(1.0), factor))
    c.closure(node, "Shader", b.scale(weight, rest))
    c.closure(node, "Shader_001", b.scale(weight, factor))


@closure_emitter("ShaderNodeAddShader")
def add_shader(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Add Shader: both, in full."""
    c.closure(node, "Shader", weight)
    c.closure(node, "Shader_001", weight)

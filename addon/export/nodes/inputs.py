"""Input nodes: what a program asks about the point, the object, the ray.

``position``, ``normal``, ``generated``, ``uv`` are what other families need where a socket is left
unlinked; all of them heed the bump stencil (Compiler.offset_params).
"""

from __future__ import annotations

import bpy
from luch.shader import ATTRIBUTE_UV, Vector

from .tree import Compiler, Outputs, emitter


def position(c: Compiler) -> Vector:
    """The point, world space (for a world: the direction)."""
    return c.builder.op3("POINT_POSITION", (), c.offset_params())


def normal(c: Compiler) -> Vector:
    """Shading normal, world space, on the side of the ray."""
    return c.builder.op3("POINT_NORMAL")


def generated(c: Compiler) -> Vector:
    """Texture Coordinate > Generated: 0..1 over Blender's texture space."""
    return c.builder.op3("POINT_GENERATED", (), c.offset_params())


def uv(c: Compiler, name: str = "") -> Vector:
    """A UV map by name, the active one without; z is 0."""
    slot = c.builder.attribute(name) if name else ATTRIBUTE_UV
    return c.builder.op("ATTRIBUTE_VALUE", (), (*c.offset_params(), slot))[:3]  # type: ignore[return-value]


@emitter("ShaderNodeValue")
def value(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Value: a number."""
    return {"Value": c.builder.constant(node.outputs[0].default_value)}


@emitter("ShaderNodeRGB")
def rgb(c: Compiler, node: bpy.types.Node) -> Outputs:
    """RGB: a colour."""
    red, green, blue, _alpha = node.outputs[0].default_value
    return {"Color": c.builder.vector(red, green, blue)}

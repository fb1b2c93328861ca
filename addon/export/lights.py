"""Lamps."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F64, Light

from .context import ExportContext
from .nodes import compile_light


def export_light(subject: Any, matrix: F64, random: float, visibility: int, context: ExportContext) -> Light:
    """A lamp in Blender's units. matrix: (3, 4) object to world."""
    lamp = subject.data
    colour = np.array(lamp.color, dtype=np.float64)
    if lamp.use_temperature:
        colour *= np.array(lamp.temperature_color, dtype=np.float64)
    colour *= 2.0**lamp.exposure
    light = Light(
        name=subject.name,
        kind=lamp.type,
        matrix=matrix,
        color=(float(colour[0]), float(colour[1]), float(colour[2])),
        power=lamp.energy,
        normalize=lamp.normalize,
        program=None if _is_plain(lamp.node_tree) else compile_light(lamp, context),
        visibility=visibility,
        cast_shadow=lamp.use_shadow,
        random=random,
    )
    _add_shape(light, lamp)
    cycles = getattr(lamp, "cycles", None)
    if cycles is not None:
        light.use_mis = cycles.use_multiple_importance_sampling
        light.max_bounces = cycles.max_bounces
        if lamp.type == "AREA" and cycles.is_portal:
            context.warn(
                f'Light "{subject.name}" is a portal; Luch samples the world without portals and leaves it out.'
            )
            light.power = 0.0
    return light


def _is_plain(tree: Any) -> bool:
    """True for the tree that Blender gives every lamp: Emission of white, strength 1. It changes nothing."""
    output = tree.get_output_node("CYCLES") if tree is not None else None
    if output is None or "Surface" not in output.inputs or len(output.inputs["Surface"].links) != 1:
        return False
    node = output.inputs["Surface"].links[0].from_node
    if node.bl_idname != "ShaderNodeEmission" or node.mute or any(socket.is_linked for socket in node.inputs):
        return False
    color, strength = node.inputs["Color"].default_value, node.inputs["Strength"].default_value
    return strength == 1.0 and tuple(color)[:3] == (1.0, 1.0, 1.0)


def _add_shape(light: Light, lamp: Any) -> None:
    if lamp.type in ("POINT", "SPOT"):
        light.radius = lamp.shadow_soft_size
        light.soft_falloff = lamp.use_soft_falloff
    if lamp.type == "SPOT":
        light.spot_size = lamp.spot_size
        light.spot_blend = lamp.spot_blend
    if lamp.type == "SUN":
        light.angle = lamp.angle
    if lamp.type == "AREA":
        light.shape = lamp.shape
        light.size = lamp.size
        light.size_y = lamp.size_y if lamp.shape in ("RECTANGLE", "ELLIPSE") else lamp.size
        light.spread = lamp.spread

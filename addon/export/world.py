"""The world: background program and how it may be seen."""

from __future__ import annotations

from typing import Any

from luch.scene import World

from .context import ExportContext
from .nodes import compile_world
from .nodes.media import medium_of
from .visibility import CAMERA, DIFFUSE, GLOSSY, SHADOW, TRANSMISSION, VOLUME


def export_world(context: ExportContext) -> World | None:
    """The view layer's world; None: black."""
    layer = context.view_layer
    world: Any = layer.world_override or context.scene.world
    if world is None or not layer.use_sky:
        return None
    result = World(name=world.name, program=compile_world(world, context), lightgroup=world.lightgroup)
    result.volume = medium_of(world, f'World "{world.name}"', context)
    cycles = getattr(world, "cycles", None)
    if cycles is not None:
        result.sampling = cycles.sampling_method
        result.map_resolution = cycles.sample_map_resolution
        result.max_bounces = cycles.max_bounces
    seen = getattr(world, "cycles_visibility", None)
    if seen is not None:
        bits = {
            "camera": CAMERA,
            "diffuse": DIFFUSE,
            "glossy": GLOSSY,
            "transmission": TRANSMISSION,
            "scatter": VOLUME,
            "shadow": SHADOW,
        }
        result.visibility = sum(bit for name, bit in bits.items() if getattr(seen, name))
    return result

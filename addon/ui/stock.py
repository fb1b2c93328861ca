"""Blender's own panels that make sense with Luch (and Cycles' for lamps, worlds and passes, which Luch obeys)."""

from __future__ import annotations

from typing import Any

import bpy

ENGINE = "LUCH"
# Panels whose content means nothing to Luch, or that our own replace.
EXCLUDED = frozenset(
    {"DATA_PT_light", "DATA_PT_spot", "NODE_DATA_PT_light", "NODE_DATA_PT_spot", "RENDER_PT_simplify"}
    | {"VIEWLAYER_PT_layer_passes", "VIEWLAYER_PT_filter", "DATA_PT_falloff_curve", "RENDER_PT_freestyle"}
)


def stock_panels() -> list[Any]:
    """Panels of Blender that any engine may use."""
    return [
        panel
        for panel in bpy.types.Panel.__subclasses__()
        if "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ()) and panel.__name__ not in EXCLUDED
    ]


def register() -> None:
    for panel in stock_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    panels: list[Any] = bpy.types.Panel.__subclasses__()
    for panel in panels:
        if ENGINE in getattr(panel, "COMPAT_ENGINES", ()):
            panel.COMPAT_ENGINES.discard(ENGINE)

"""Blender's own panels that make sense with Luch."""

from __future__ import annotations

from typing import Any

import bpy

ENGINE = "LUCH"
# Panels for every engine whose content means nothing to Luch, or that our own replace.
EXCLUDED = frozenset(
    {"DATA_PT_light", "DATA_PT_spot", "DATA_PT_falloff_curve", "RENDER_PT_simplify", "RENDER_PT_freestyle"}
)
# Panels that name their engines one by one, and whose content Luch obeys.
INCLUDED = frozenset(
    {
        "DATA_PT_camera_dof",
        "DATA_PT_camera_dof_aperture",
        "EEVEE_MATERIAL_PT_context_material",
        "EEVEE_MATERIAL_PT_surface",
        "EEVEE_MATERIAL_PT_displacement",
        "EEVEE_WORLD_PT_surface",
        "EEVEE_WORLD_PT_mist",
        "MATERIAL_PT_preview",
        "VIEWLAYER_PT_layer_passes",
        "VIEWLAYER_PT_layer_passes_aov",
        "VIEWLAYER_PT_layer_passes_cryptomatte",
        "VIEWLAYER_PT_layer_passes_lightgroups",
        "VIEWLAYER_PT_override",
    }
)


def stock_panels() -> list[Any]:
    """Blender's panels that Luch wants to see."""
    return [
        panel
        for panel in bpy.types.Panel.__subclasses__()
        if panel.__name__ in INCLUDED
        or ("BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ()) and panel.__name__ not in EXCLUDED)
    ]


def register() -> None:
    for panel in stock_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    for panel in stock_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)

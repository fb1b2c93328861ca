"""The panel of hair: what curves look like; the settings are those that Cycles stores."""

from __future__ import annotations

from typing import Any

import bpy

from .panels import LuchPanel


class LUCH_RENDER_PT_hair(LuchPanel, bpy.types.Panel):
    """The shape of all hair of the scene."""

    bl_label = "Curves"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return hasattr(context.scene, "cycles_curves") and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout, curves = self.layout, getattr(context.scene, "cycles_curves", None)
        layout.use_property_split = True
        layout.use_property_decorate = False
        if curves is None:
            return
        layout.prop(curves, "shape", text="Shape")
        if curves.shape == "RIBBONS":
            layout.prop(curves, "subdivisions", text="Curve Subdivisions")


def register() -> None:
    bpy.utils.register_class(LUCH_RENDER_PT_hair)


def unregister() -> None:
    bpy.utils.unregister_class(LUCH_RENDER_PT_hair)

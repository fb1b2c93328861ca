"""Panels of lamps, worlds, objects and materials: what Luch reads of them.

Settings that only Cycles stores (`light.cycles`, `world.cycles`) are shown where that add-on is enabled, as it is by
default.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy_extras.node_utils import find_node_input

from .panels import LuchPanel

RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def _begin(layout: Any) -> Any:
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


class LUCH_LIGHT_PT_light(LuchPanel, bpy.types.Panel):
    """Colour, power and shape of a lamp."""

    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.light is not None and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout, lamp = _begin(self.layout), context.light
        layout.row().prop(lamp, "type", expand=True)
        column = layout.column()
        column.prop(lamp, "color")
        column.prop(lamp, "use_temperature")
        if lamp.use_temperature:
            column.prop(lamp, "temperature")
        column.prop(lamp, "energy", text="Strength" if lamp.type == "SUN" else "Power")
        column.prop(lamp, "exposure")
        column.prop(lamp, "normalize")
        self.draw_shape(layout.column(), lamp)
        column = layout.column()
        column.prop(lamp, "use_shadow")
        cycles = getattr(lamp, "cycles", None)
        if cycles is not None:
            column.prop(cycles, "max_bounces")
            column.prop(cycles, "use_multiple_importance_sampling", text="Multiple Importance")

    @staticmethod
    def draw_shape(column: Any, lamp: Any) -> None:
        if lamp.type in ("POINT", "SPOT"):
            column.prop(lamp, "shadow_soft_size", text="Radius")
            column.prop(lamp, "use_soft_falloff")
        if lamp.type == "SPOT":
            column.prop(lamp, "spot_size")
            column.prop(lamp, "spot_blend")
        if lamp.type == "SUN":
            column.prop(lamp, "angle")
        if lamp.type == "AREA":
            column.prop(lamp, "shape")
            column.prop(lamp, "size")
            if lamp.shape in ("RECTANGLE", "ELLIPSE"):
                column.prop(lamp, "size_y")
            column.prop(lamp, "spread")


class LUCH_LIGHT_PT_nodes(LuchPanel, bpy.types.Panel):
    """A lamp's own shader."""

    bl_label = "Nodes"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.light is not None and context.light.node_tree is not None and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        tree: Any = context.light.node_tree
        output = tree.get_output_node("CYCLES")
        if output is None:
            self.layout.label(text="No output node")
        else:
            self.layout.template_node_view(tree, output, find_node_input(output, "Surface"))


class LUCH_WORLD_PT_settings(LuchPanel, bpy.types.Panel):
    """How a world is sampled, and which rays see it."""

    bl_label = "Settings"
    bl_context = "world"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return hasattr(context.world, "cycles") and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout, world = _begin(self.layout), context.world
        column = layout.column()
        column.prop(world.cycles, "sampling_method", text="Sampling")
        if world.cycles.sampling_method == "MANUAL":
            column.prop(world.cycles, "sample_map_resolution")
        column.prop(world.cycles, "max_bounces")
        column = layout.column(heading="Ray Visibility")
        for name in ("camera", "diffuse", "glossy", "transmission", "scatter"):
            column.prop(world.cycles_visibility, name)


class LUCH_OBJECT_PT_ray_visibility(LuchPanel, bpy.types.Panel):
    """Which rays see an object."""

    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        column = _begin(self.layout).column()
        for name in RAYS:
            column.prop(context.object, f"visible_{name}", text=name.replace("_", " ").title())
        column.prop(context.object, "is_holdout")


class LUCH_MATERIAL_PT_settings(LuchPanel, bpy.types.Panel):
    """What is no node of a material."""

    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.material is not None and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        column = _begin(self.layout).column()
        column.prop(context.material, "pass_index")
        column.prop(context.material, "use_transparent_shadow")
        cycles = getattr(context.material, "cycles", None)
        if cycles is not None:
            column.prop(cycles, "emission_sampling")


CLASSES = (
    LUCH_LIGHT_PT_light,
    LUCH_LIGHT_PT_nodes,
    LUCH_WORLD_PT_settings,
    LUCH_OBJECT_PT_ray_visibility,
    LUCH_MATERIAL_PT_settings,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)

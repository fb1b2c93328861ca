"""Panels of motion blur: when the shutter is open, and which objects and cameras are told to stand still."""

from __future__ import annotations

from typing import Any

import bpy

from .panels import LuchPanel


class LUCH_RENDER_PT_motion_blur(LuchPanel, bpy.types.Panel):
    """The shutter."""

    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = self.layout, context.scene.render
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = render.use_motion_blur
        column = layout.column()
        column.prop(render, "motion_blur_position", text="Position")
        column.prop(render, "motion_blur_shutter")
        cycles = getattr(context.scene, "cycles", None)
        if cycles is not None:
            column.prop(cycles, "rolling_shutter_type", text="Rolling Shutter")
            if cycles.rolling_shutter_type != "NONE":
                column.prop(cycles, "rolling_shutter_duration", text="Rolling Shutter Duration")


class LUCH_RENDER_PT_motion_blur_curve(LuchPanel, bpy.types.Panel):
    """How far it is open."""

    bl_label = "Shutter Curve"
    bl_parent_id = "LUCH_RENDER_PT_motion_blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        render = context.scene.render
        self.layout.active = render.use_motion_blur
        self.layout.template_curve_mapping(render, "motion_blur_shutter_curve")


class LUCH_OBJECT_PT_motion_blur(LuchPanel, bpy.types.Panel):
    """What an object or a camera may do while the shutter is open; the settings are those that Cycles stores."""

    bl_label = "Motion Blur"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        subject: Any = context.object
        return subject is not None and hasattr(subject, "cycles") and super().poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout, subject = self.layout, context.object
        settings: Any = getattr(subject, "cycles", None)
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = context.scene.render.use_motion_blur
        column = layout.column()
        column.prop(settings, "use_motion_blur")
        column = column.column()
        column.active = settings.use_motion_blur
        if subject is not None and subject.type != "CAMERA":
            column.prop(settings, "use_deform_motion", text="Deformation")
        column.prop(settings, "motion_steps", text="Steps")


CLASSES = (LUCH_RENDER_PT_motion_blur, LUCH_RENDER_PT_motion_blur_curve, LUCH_OBJECT_PT_motion_blur)


def register() -> None:
    for panel in CLASSES:
        bpy.utils.register_class(panel)


def unregister() -> None:
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)

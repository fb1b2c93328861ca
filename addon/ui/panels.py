"""Render Properties and View Layer Properties of Luch."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy
from luch import integrators

from ..settings import effective, follows_cycles


class LuchPanel:
    """Shown while Luch is the scene's engine."""

    bl_space_type: Any = "PROPERTIES"
    bl_region_type: Any = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {"LUCH"}
    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine in cls.COMPAT_ENGINES


def draw_settings(layout: Any, scene: Any, *names: str, idle: Collection[str] = ()) -> None:
    """One row a setting; where Cycles' value holds, it stands beside. idle: those that change nothing are dimmed."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name in names:
        row = layout.row()
        row.active = name not in idle
        row.prop(scene.luch, name)
        if follows_cycles(scene, name):
            value = effective(scene, name)
            row.label(text=f"Cycles: {value:.4g}" if isinstance(value, float) else f"Cycles: {value}")


class LUCH_RENDER_PT_sampling(LuchPanel, bpy.types.Panel):
    """Samples, time, error."""

    bl_label = "Sampling"

    def draw(self, context: Any) -> None:
        scene = context.scene
        draw_settings(self.layout, scene, "quality")
        custom = scene.luch.quality == "CUSTOM"
        if not custom:
            draw_settings(self.layout, scene, "quality_by_report")
        draw_settings(
            self.layout,
            scene,
            *(("samples",) if custom else ()),
            "time_limit",
            *(("error_limit_percent", "use_adaptive_sampling", "use_denoising") if custom else ()),
            "verify",
            "estimate_error",
        )
        row = self.layout.row(align=True)
        row.prop(context.scene.luch, "follow_cycles")
        row.operator("luch.follow_cycles", text="", icon="LOOP_BACK")


class LUCH_RENDER_PT_viewport(LuchPanel, bpy.types.Panel):
    """What ends the picture of a 3D viewport."""

    bl_label = "Viewport"
    bl_parent_id = "LUCH_RENDER_PT_sampling"

    def draw(self, context: Any) -> None:
        names = ("preview_samples", "preview_time_limit", "preview_error_limit_percent")
        draw_settings(self.layout, context.scene, *names)
        self.layout.prop(context.scene.render, "preview_pixel_size")


class LUCH_RENDER_PT_sampling_advanced(LuchPanel, bpy.types.Panel):
    """Which random numbers paths draw."""

    bl_label = "Advanced"
    bl_parent_id = "LUCH_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        draw_settings(self.layout, context.scene, "seed", "use_animated_seed", "sampling_pattern")


class LUCH_RENDER_PT_lights(LuchPanel, bpy.types.Panel):
    """How lights are chosen."""

    bl_label = "Lights"
    bl_parent_id = "LUCH_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        draw_settings(self.layout, context.scene, "use_light_tree", "light_sampling_threshold")


class LUCH_RENDER_PT_light_paths(LuchPanel, bpy.types.Panel):
    """Bounces by kind."""

    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        draw_settings(
            self.layout,
            context.scene,
            "integrator",
            "max_bounces",
            "diffuse_bounces",
            "glossy_bounces",
            "transmission_bounces",
            "volume_bounces",
            "transparent_max_bounces",
            "min_light_bounces",
            "min_transparent_bounces",
            idle={f"{kind}_bounces" for kind in integrators.named(context.scene.luch.integrator).ends_at},
        )


class LUCH_RENDER_PT_bias(LuchPanel, bpy.types.Panel):
    """What trades light for less noise. All off by default."""

    bl_label = "Clamping and Caustics"
    bl_parent_id = "LUCH_RENDER_PT_light_paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        draw_settings(
            self.layout,
            context.scene,
            "sample_clamp_direct",
            "sample_clamp_indirect",
            "blur_glossy",
            "caustics_reflective",
            "caustics_refractive",
        )


class LUCH_RENDER_PT_film(LuchPanel, bpy.types.Panel):
    """Exposure, transparency, pixel filter."""

    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        scene = context.scene
        draw_settings(self.layout, scene, "film_exposure", "pixel_filter_type", "filter_width")
        self.layout.prop(scene.render, "film_transparent")
        if scene.render.film_transparent:
            draw_settings(self.layout, scene, "film_transparent_glass", "film_transparent_roughness")


class LUCH_RENDER_PT_performance(LuchPanel, bpy.types.Panel):
    """Device, threads, memory against time."""

    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        scene = context.scene
        draw_settings(
            self.layout,
            scene,
            "device",
            *(("gpus", "texture_memory", "own_kernels") if scene.luch.device == "CUDA" else ()),
            "accelerator",
            "precision",
            "threads",
        )
        self.layout.prop(scene.render, "use_persistent_data")


class LUCH_VIEWLAYER_PT_passes_data(LuchPanel, bpy.types.Panel):
    """Passes that say what is where."""

    bl_label = "Data"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        layout, layer = self.layout, context.view_layer
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Include")
        for name in ("combined", "z", "mist", "position", "normal", "uv", "object_index", "material_index"):
            column.prop(layer, f"use_pass_{name}")
        column.prop(layer.luch, "use_pass_denoising")
        column.prop(layer.luch, "use_pass_sample_count")
        column.prop(layer.luch, "use_pass_render_time")
        column.prop(layer.luch, "use_pass_error")
        column.prop(layer.luch, "use_pass_reliability")
        layout.prop(layer, "pass_alpha_threshold")


class LUCH_VIEWLAYER_PT_passes_light(LuchPanel, bpy.types.Panel):
    """Passes that split the light by what it met."""

    bl_label = "Light"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        layout, layer = self.layout, context.view_layer
        layout.use_property_split = True
        layout.use_property_decorate = False
        for kind in ("diffuse", "glossy", "transmission"):
            row = layout.row(heading=kind.title(), align=True)
            for part in ("direct", "indirect", "color"):
                row.prop(layer, f"use_pass_{kind}_{part}", text=part.title(), toggle=True)
        column = layout.column(heading="Other")
        for name in ("emit", "environment", "ambient_occlusion"):
            column.prop(layer, f"use_pass_{name}")


CLASSES = (
    LUCH_RENDER_PT_sampling,
    LUCH_RENDER_PT_viewport,
    LUCH_RENDER_PT_sampling_advanced,
    LUCH_RENDER_PT_lights,
    LUCH_RENDER_PT_light_paths,
    LUCH_RENDER_PT_bias,
    LUCH_RENDER_PT_film,
    LUCH_RENDER_PT_performance,
    LUCH_VIEWLAYER_PT_passes_data,
    LUCH_VIEWLAYER_PT_passes_light,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)

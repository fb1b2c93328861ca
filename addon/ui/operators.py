"""Operators: writing a scene file, following Cycles again."""

from __future__ import annotations

import os
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from .. import engine
from ..settings import SHARED_WITH_CYCLES


class LUCH_OT_export_scene(bpy.types.Operator, ExportHelper):
    """Write the current frame as a .luch file, which renders anywhere without Blender: python -m luch render"""

    bl_idname = "luch.export_scene"
    bl_label = "Export Luch Scene"
    filename_ext = ".luch"
    filter_glob: StringProperty(default="*.luch", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH")

    def execute(self, context: bpy.types.Context) -> set[str]:
        from luch.scenefile import write_scene

        path = bpy.path.abspath(self.filepath)
        try:
            scene = engine.capture_scene(context.scene, context.view_layer)
            write_scene(scene, path)
        except (RuntimeError, OSError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{path}: {os.path.getsize(path) / 1e6:.1f} MB")
        return {"FINISHED"}


class LUCH_OT_follow_cycles(bpy.types.Operator):
    """Forget Luch's own values of the settings that both engines have: Cycles' hold again"""

    bl_idname = "luch.follow_cycles"
    bl_label = "Follow Cycles Again"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.luch
        settings.follow_cycles = True
        for name in SHARED_WITH_CYCLES:
            settings.property_unset(name)
        return {"FINISHED"}


CLASSES = (LUCH_OT_export_scene, LUCH_OT_follow_cycles)


EXPORT_MENU: Any = bpy.types.TOPBAR_MT_file_export


def draw_in_export_menu(menu: Any, context: Any) -> None:
    """File > Export."""
    menu.layout.operator(LUCH_OT_export_scene.bl_idname, text="Luch Scene (.luch)")


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    EXPORT_MENU.append(draw_in_export_menu)


def unregister() -> None:
    EXPORT_MENU.remove(draw_in_export_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)

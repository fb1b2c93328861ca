"""From Blender's dependency graph to `luch.scene.Scene`; one file per kind of thing in Blender."""

from .scene import export_scene, export_view_scene, seen_anew

__all__ = ["export_scene", "export_view_scene", "seen_anew"]

"""Luch for Blender: the only code of the project that imports bpy."""

from __future__ import annotations

from . import engine, properties, ui


def register() -> None:
    """Make Luch one of Blender's render engines."""
    properties.register()
    engine.register()
    ui.register()


def unregister() -> None:
    """Leave Blender as it was before `register`."""
    ui.unregister()
    engine.unregister()
    properties.unregister()

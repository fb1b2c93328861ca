"""The list of effects of the last render: what was simulated, what was not, and why."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

import bpy

from .. import engine
from .panels import LuchPanel

ICONS = {"on": "CHECKMARK", "not yet": "ERROR", "off": "DOT"}
_LETTER_PIXELS = 8.0  # at 100 % of Blender's resolution scale
_LEAST_LETTERS = 24
_INDENT = "    "

Row = tuple[str, dict[str, Any]]  # name and what luch.effects says of it


def rows_of_last_render(scene: Any) -> list[Row]:
    """Of the scene's last render; none before the first."""
    return list(engine.last_stats.get(scene.name, {}).get("effects", {}).items())


def state(row: dict[str, Any]) -> str:
    """ "on", "not yet" (the scene asks for it in vain) or "off"."""
    return "not yet" if row.get("missing") else "on" if row["on"] else "off"


def draw_rows(layout: Any, rows: Iterable[Row], letters: int) -> None:
    """Name with its icon, then the reason, wrapped: labels would cut it."""
    column = layout.column(align=True)
    group = ""
    for name, row in rows:
        if row["group"] != group:
            group = row["group"]
            column.label(text=group)
        column.label(text=name, icon=ICONS[state(row)])
        cost = f" ({row['cost']})" if row.get("cost") else ""
        for line in textwrap.wrap(row["reason"] + cost, letters):
            column.label(text=_INDENT + line)


def letters_across(context: Any) -> int:
    """How many letters fit beside each other in the panel."""
    region = getattr(context, "region", None)
    width = region.width if region else 0
    scale = context.preferences.system.ui_scale or 1.0  # 0 without a window
    return max(_LEAST_LETTERS, int(width / (_LETTER_PIXELS * scale)))


class LUCH_RENDER_PT_effects(LuchPanel, bpy.types.Panel):
    """What the last render simulated, and what it was asked for in vain."""

    bl_label = "Effects"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        rows = [(name, row) for name, row in rows_of_last_render(context.scene) if state(row) != "off"]
        if rows:
            draw_rows(self.layout, rows, letters_across(context))
        else:
            self.layout.label(text="Known after the first render")


class LUCH_RENDER_PT_effects_off(LuchPanel, bpy.types.Panel):
    """What the last render did not simulate."""

    bl_label = "Not in This Scene"
    bl_parent_id = "LUCH_RENDER_PT_effects"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and bool(rows_of_last_render(context.scene))

    def draw(self, context: Any) -> None:
        rows = [(name, row) for name, row in rows_of_last_render(context.scene) if state(row) == "off"]
        draw_rows(self.layout, rows, letters_across(context))


CLASSES = (LUCH_RENDER_PT_effects, LUCH_RENDER_PT_effects_off)

register, unregister = bpy.utils.register_classes_factory(CLASSES)

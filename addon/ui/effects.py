"""The list of effects of the last render: what was simulated, what was not, and why."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

import bpy

from .. import engine
from ..settings import names_of
from .panels import LuchPanel

ICONS = {"on": "CHECKMARK", "not yet": "ERROR", "off": "DOT", "left out": "CANCEL"}
_LETTER_PIXELS = 8.0  # at 100 % of Blender's resolution scale
_LEAST_LETTERS = 24
_INDENT = "    "

Row = tuple[str, dict[str, Any]]  # name and what luch.effects says of it


def rows_of_last_render(scene: Any) -> list[Row]:
    """Of the scene's last render; none before the first."""
    return list(engine.last_stats.get(scene.name, {}).get("effects", {}).items())


def state(row: dict[str, Any]) -> str:
    """ "on", "not yet" (the scene asks for it in vain), "left out" (by the user) or "off"."""
    return "not yet" if row.get("missing") else "left out" if row.get("left_out") else "on" if row["on"] else "off"


def draw_rows(layout: Any, rows: Iterable[Row], letters: int, left_out: Iterable[str] = ()) -> None:
    """Name with its icon, then the reason, wrapped: labels would cut it. left_out: by the next render."""
    column = layout.column(align=True)
    group = ""
    for name, row in rows:
        if row["group"] != group:
            group = row["group"]
            column.label(text=group)
        line = column.row()
        line.label(text=name, icon=ICONS[state(row)])
        if state(row) in ("on", "left out") and instead(name):
            gone = name in left_out
            line.operator(
                "luch.leave_out_effect", text="", icon="HIDE_ON" if gone else "HIDE_OFF", emboss=gone
            ).effect = name
        cost = f" ({row['cost']})" if row.get("cost") else ""
        for line in textwrap.wrap(row["reason"] + cost, letters):
            column.label(text=_INDENT + line)


def instead(name: str) -> str:
    """What is drawn where an effect is left out; "" for one that cannot be."""
    from luch.effects.removal import REMOVALS  # loads the core: not while Blender starts

    return REMOVALS[name].instead if name in REMOVALS else ""


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
            draw_rows(self.layout, rows, letters_across(context), names_of(context.scene.luch.without_effects))
        else:
            self.layout.label(text="Known after the first render")
        self.layout.prop(context.scene.luch, "force_effects")


class LUCH_OT_leave_out_effect(bpy.types.Operator):
    """Leave this effect out of the next render, or take it in again"""

    bl_idname = "luch.leave_out_effect"
    bl_label = "Leave Out Effect"
    bl_options = {"REGISTER", "UNDO"}

    effect: bpy.props.StringProperty()

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        """What is drawn instead."""
        return f"Leave this effect out of the next render, or take it in again. Instead: {instead(properties.effect)}"

    def execute(self, context: Any) -> set[str]:
        if not instead(self.effect):
            self.report({"ERROR"}, f'The effect "{self.effect}" cannot be left out.')
            return {"CANCELLED"}
        names = names_of(context.scene.luch.without_effects)
        left = [name for name in names if name != self.effect]
        context.scene.luch.without_effects = "; ".join(left if self.effect in names else [*names, self.effect])
        return {"FINISHED"}


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


CLASSES = (LUCH_OT_leave_out_effect, LUCH_RENDER_PT_effects, LUCH_RENDER_PT_effects_off)

register, unregister = bpy.utils.register_classes_factory(CLASSES)

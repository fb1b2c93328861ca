"""What the last render, or the one under way, knows of its error: numbers, forecast, curve."""

from __future__ import annotations

from typing import Any

import bpy
import bpy.utils.previews
from luch.accuracy import percent
from luch.record import ENDS, notes, verdict

from .. import engine
from .panels import LuchPanel
from .plot import HEIGHT, WIDTH, draw_curve

ICON_SCALE = 9.0  # of the plot, in heights of a row
_previews: Any = None
_drawn: tuple[Any, ...] = ()  # what the plot shows


def rows(stats: dict[str, Any]) -> list[str]:
    """One line a fact."""
    low, high = percent(stats["error_low"]), percent(stats["error_high"])
    lines = [f"Error {percent(stats['error'])} % (95 %: {low} to {high} %)"]
    lines.append(f"{percent(stats['fireflies_share'])} % of it in the worst 0.1 % of pixels")
    half = 0.5 * (stats["brightness_high"] - stats["brightness_low"]) / max(abs(stats["brightness"]), 1e-9)
    lines.append(f"Brightness within {percent(half)} %")
    if stats.get("seconds_to_next_error", 0.0) > 0.0:
        ahead = [stats[f"seconds_to_next_error{end}"] for end in ("", "_low", "_high")]
        lines.append(
            f"{stats['next_error'] * 100:g} % takes {ahead[0]:.2g} s more (80 %: {ahead[1]:.2g} to {ahead[2]:.2g} s)"
        )
    lines.append(f"{stats['samples']} samples, {stats['render_seconds']:.1f} s")
    if stats.get("stopped_by") in ENDS:
        lines[-1] += f": {ENDS[stats['stopped_by']]}"
    lines += notes(stats)
    if "verified" in stats:
        lines.append(verdict(stats["verified"]).capitalize())
    return lines


def plot_icon(stats: dict[str, Any]) -> int:
    """Number of an icon that shows the curve, for UILayout.template_icon."""
    global _previews, _drawn
    points = tuple(tuple(point[1:5]) for point in stats["error_curve"])
    aim = stats.get("error_asked") or stats.get("next_error", 0.0)
    seconds = points[-1][0] + stats.get("seconds_to_next_error", 0.0) if points else 0.0
    wanted = (points, aim, seconds if aim == stats.get("next_error") else float("inf"))
    if _previews is None:
        _previews = bpy.utils.previews.new()
    if "curve" not in _previews:
        _previews.new("curve")
        _drawn = ()
    preview = _previews["curve"]
    if wanted != _drawn:
        picture = draw_curve(*wanted)
        preview.image_size = (WIDTH, HEIGHT)
        preview.image_pixels_float.foreach_set(picture.ravel())
        _drawn = wanted
    return int(preview.icon_id)


class LUCH_RENDER_PT_accuracy(LuchPanel, bpy.types.Panel):
    """The error of the last render and what less would cost."""

    bl_label = "Accuracy"

    def draw(self, context: Any) -> None:
        draw = self.layout.column(align=True)
        stats = engine.live_stats.get(context.scene.name) or engine.last_stats.get(context.scene.name, {})
        if "error" not in stats:
            draw.label(text="Known after a few samples")
            return
        for text in rows(stats):
            draw.label(text=text)
        self.layout.template_icon(icon_value=plot_icon(stats), scale=ICON_SCALE)


def register() -> None:
    bpy.utils.register_class(LUCH_RENDER_PT_accuracy)


def unregister() -> None:
    global _previews
    bpy.utils.unregister_class(LUCH_RENDER_PT_accuracy)
    if _previews is not None:
        bpy.utils.previews.remove(_previews)
        _previews = None

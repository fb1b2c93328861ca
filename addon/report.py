"""What a render tells its user: progress, time left, memory, warnings, errors, statistics."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import bpy
from luch import record
from luch.accuracy import percent
from luch.curve import next_target
from luch.scene import Scene

if TYPE_CHECKING:
    from .result import ResultWriter

FIRST_PICTURE_S = 0.5
PICTURE_INTERVAL_GROWTH = 1.5
LONGEST_PICTURE_INTERVAL_S = 20.0
MIB = 1024.0 * 1024.0


class Reporter:
    """Speaks for one render through Blender's status line, info area and console."""

    def __init__(self, engine: Any, scene: Any) -> None:
        self._engine = engine
        self.scene_name = scene.name
        self._interval_s = FIRST_PICTURE_S
        self._next_picture = time.monotonic() + FIRST_PICTURE_S
        self._peak_memory_mib = 0.0
        self._started = time.monotonic()
        self._export_s = 0.0
        self.cancelled = False

    def say(self, text: str) -> None:
        """Put a line into the render's header."""
        self._engine.update_stats("", f"Luch: {text}")

    def warn(self, warnings: list[str]) -> None:
        """Show each warning of the export in the info area; the export has ended here."""
        self._export_s = time.monotonic() - self._started
        self.show(warnings)

    def show(self, warnings: list[str]) -> None:
        """In the info area, each on a line of its own."""
        for warning in warnings:
            self._engine.report({"WARNING"}, warning)

    def progress(self, progress: Any, writer: ResultWriter) -> bool:
        """Called by the renderer between batches. False: the user wants it to end."""
        self._peak_memory_mib = max(self._peak_memory_mib, progress.memory_bytes / MIB)
        self._engine.update_progress(progress.fraction)
        self._engine.update_memory_stats(memory_used=progress.memory_bytes / MIB, memory_peak=self._peak_memory_mib)
        self._engine.update_stats("", progress_line(progress))
        self._show_picture(progress, writer)
        self.cancelled = self.user_wants_to_stop()
        return not self.cancelled

    def user_wants_to_stop(self) -> bool:
        """Escape was pressed, or the window closed."""
        return bool(self._engine.test_break())

    def statistics(self, scene: Scene, stats: dict[str, Any]) -> dict[str, Any]:
        """Everything known about the render, fit for JSON."""
        return {
            **stats,
            "scene": scene.name,
            "frame": scene.frame,
            "seed": scene.settings.seed,
            "device": stats.get("device", "CPU"),
            "export_seconds": round(self._export_s, 4),
            "total_seconds": round(time.monotonic() - self._started, 4),
            "cancelled": self.cancelled,
        }

    def say_how_it_went(self, stats: dict[str, Any]) -> None:
        """One line for those who read the console of a headless render."""
        if not is_watched():
            print(f"Luch: {stats['scene']}, frame {stats['frame']}: {record.line(stats)}", flush=True)

    def _show_picture(self, progress: Any, writer: ResultWriter) -> None:
        """The film so far, ever less often: converting it costs, and late changes are small."""
        now = time.monotonic()
        if not is_watched() or not progress.new_picture or now < self._next_picture:
            return
        writer.show(progress.passes())
        self._interval_s = min(self._interval_s * PICTURE_INTERVAL_GROWTH, LONGEST_PICTURE_INTERVAL_S)
        self._next_picture = time.monotonic() + self._interval_s


def is_watched() -> bool:
    """True if somebody can see the picture grow."""
    return not bpy.app.background


def progress_line(progress: Any) -> str:
    """For the status line: "Sample 32/128 | Remaining 00:14 | 312 MiB"."""
    if progress.preparing:
        return str(progress.doing_before)
    parts = [f"Sample {progress.samples}/{progress.total_samples}"]
    if progress.error is not None:
        parts.append(f"Error {percent(progress.error)} %")
        parts += forecast_of(progress)
    if math.isfinite(progress.remaining_seconds):
        parts.append(f"Remaining {clock(progress.remaining_seconds)}")
    parts.append(f"{progress.memory_bytes / MIB:.0f} MiB")
    return " | ".join(parts)


def viewport_line(progress: Any) -> str:
    """For a 3D view's status: "Sample 64/1024 | Error 0.80 % (0.70 to 0.90 %) - 12 s to 0.5 %"."""
    if progress.preparing:
        return str(progress.doing_before)
    parts = [f"Sample {progress.samples}/{progress.total_samples}"]
    found = progress.curve.last if progress.curve is not None else None
    if found is not None:
        text = f"Error {percent(found.error)} % ({percent(found.error_low)} to {percent(found.error_high)} %)"
        aim = progress.asked_error or (next_target(found.error) if found.error > 0.0 else 0.0)
        ahead = progress.forecast
        if ahead is not None and 0.0 < ahead.seconds < math.inf:
            text += f" - {ahead.seconds:.2g} s to {aim * 100:g} %"
        parts.append(text)
    return " | ".join(parts)


def viewport_end_line(stats: Mapping[str, Any]) -> str:
    """The same of a picture that is finished, and why it is."""
    parts = [f"Sample {stats['samples']}/{stats['samples_asked']}"]
    if "error" in stats:
        low, high = percent(stats["error_low"]), percent(stats["error_high"])
        parts.append(f"Error {percent(stats['error'])} % ({low} to {high} %)")
    if stats.get("stopped_by") in record.ENDS:
        parts.append(record.ENDS[stats["stopped_by"]].capitalize())
    notes = len(stats["warnings"])
    if notes:
        parts.append("1 note in the console" if notes == 1 else f"{notes} notes in the console")
    return " | ".join(parts)


def forecast_of(progress: Any) -> list[str]:
    """ "1 % in 41 s (34 to 52)": the error asked for, else the next round one. Nothing where it is reached."""
    ahead, found = progress.forecast, progress.error
    aim = progress.asked_error or (next_target(found) if found > 0.0 else 0.0)
    if ahead is None or not ahead.seconds > 0.0 or not math.isfinite(ahead.seconds):
        return []
    return [f"{aim * 100:g} % in {ahead.seconds:.2g} s ({ahead.seconds_low:.2g} to {ahead.seconds_high:.2g})"]


def clock(seconds: float) -> str:
    """Seconds as Blender writes them: mm:ss, or h:mm:ss."""
    whole = round(min(seconds, 359_999.0))  # silly estimates end here
    hours, rest = divmod(whole, 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes:02d}:{left:02d}"


def describe_error(error: BaseException) -> str:
    """One sentence for the info area; the traceback goes to the console."""
    if isinstance(error, KeyboardInterrupt):
        return "Luch: the render was interrupted."
    if isinstance(error, MemoryError):
        if "bytes" in str(error):  # luch.memory says how many, and what to do
            return f"Luch: {error}"
        return "Luch: there is not enough memory for this scene. Lower the resolution or simplify the scene."
    if isinstance(error, ImportError):
        return f"Luch: its ray tracing core cannot be loaded ({error}). Install the extension again."
    text = " ".join(_text_of(error).split()) or type(error).__name__
    return f"Luch: {text}" if isinstance(error, ValueError) else f"Luch: {text} ({type(error).__name__})"


def _text_of(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:  # an exception of others may be broken itself: its name will do
        return ""

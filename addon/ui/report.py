"""The button that makes a report of what accuracy costs in this scene, its progress, and what it came to."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import bpy

from .. import engine
from ..report import clock
from ..report_job import ReportJob, file_name, folder_of
from .accuracy import LUCH_RENDER_PT_accuracy
from .effects import letters_across
from .panels import LuchPanel

POLL_S = 0.25
SHOWN = 6  # sentences in the panel; all stand in the file

job: ReportJob | None = None
# Of the last report of each scene, by its name: what it came to, where its page lies.
results: dict[str, tuple[list[str], Path]] = {}
_of_scene = ""


def start(scene: Any, view_layer: Any) -> ReportJob:
    """Exports the scene and starts the process. Raises RuntimeError or OSError with the reason."""
    global job, _of_scene
    captured = engine.capture_scene(scene, view_layer)
    job, _of_scene = ReportJob(captured, folder_of(scene), scene.luch.report_seconds, file_name(scene)), scene.name
    return job


def end() -> str:
    """Of a process that has ended: keeps what it came to; "" or why there is no report."""
    global job
    assert job is not None
    reason = job.finish()
    if not reason:
        results[_of_scene] = (job.sentences, job.page)
    job = None
    return reason


def _watch() -> float | None:
    """Called by Blender while a report is made: seconds until the next call."""
    if job is None:
        return None
    if job.running:
        _redraw()
        return POLL_S
    reason = end()
    _redraw()
    if reason:
        print(f"Luch: no report: {reason}")
    elif _of_scene in results:
        bpy.ops.wm.url_open(url=results[_of_scene][1].as_uri())
    return None


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()


class LUCH_OT_report(bpy.types.Operator):
    """Render the scene small and in many ways, for as long as said: which settings reach the least error, what each effect costs. Blender stays free meanwhile"""

    bl_idname = "luch.report"
    bl_label = "Report What Accuracy Costs"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return job is None

    def execute(self, context: Any) -> set[str]:
        try:
            started = start(context.scene, context.view_layer)
        except (RuntimeError, OSError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        if not bpy.app.background:
            bpy.app.timers.register(_watch, first_interval=POLL_S)
            return {"FINISHED"}
        reason = end()  # nobody waits at a window
        if reason:
            self.report({"ERROR"}, f"No report: {reason}")
            return {"CANCELLED"}
        self.report({"INFO"}, str(started.page))
        return {"FINISHED"}


class LUCH_OT_cancel_report(bpy.types.Operator):
    """End the report that is being made; what it found so far is kept"""

    bl_idname = "luch.cancel_report"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return job is not None

    def execute(self, context: Any) -> set[str]:
        if job is not None:
            job.cancel()
        return {"FINISHED"}


class LUCH_RENDER_PT_report(LuchPanel, bpy.types.Panel):
    """What accuracy costs in this scene."""

    bl_label = "Report"
    bl_parent_id = LUCH_RENDER_PT_accuracy.__name__
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(scene.luch, "report_seconds")
        column.prop(scene.luch, "report_folder")
        if job is not None:
            row = layout.row()
            row.progress(factor=job.fraction, text=f"{job.doing}, {clock(job.left_s)} left")
            row.operator(LUCH_OT_cancel_report.bl_idname, text="", icon="X")
        else:
            layout.operator(LUCH_OT_report.bl_idname, icon="GRAPH")
        if scene.name in results:
            sentences, page = results[scene.name]
            self._draw_result(sentences, page, letters_across(context))

    def _draw_result(self, sentences: list[str], page: Path, letters: int) -> None:
        column = self.layout.column(align=True)
        for sentence in sentences[:SHOWN]:
            for number, line in enumerate(textwrap.wrap(sentence, letters)):
                column.label(text=line, icon="BLANK1" if number else "DOT")
        self.layout.operator("wm.url_open", text="Open Report", icon="URL").url = page.as_uri()


CLASSES = (LUCH_OT_report, LUCH_OT_cancel_report, LUCH_RENDER_PT_report)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    global job
    if job is not None:
        job.kill()
        job = None
    if bpy.app.timers.is_registered(_watch):
        bpy.app.timers.unregister(_watch)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)

"""The report's button: a process of its own, progress, cancelling, sentences in the panel."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from support.blender import empty_scene

from addon import report_job
from addon.ui import report


@pytest.fixture
def lit(tmp_path: Path) -> bpy.types.Scene:
    scene = empty_scene()
    bpy.ops.mesh.primitive_plane_add(size=4)
    bpy.ops.object.light_add(type="AREA", location=(0, 0, 3))
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    scene.luch.report_seconds, scene.luch.report_folder = 2.9, str(tmp_path)
    return scene


def test_the_button_makes_a_report_and_keeps_its_sentences(lit: bpy.types.Scene, tmp_path: Path) -> None:
    assert bpy.ops.luch.report() == {"FINISHED"}
    sentences, page = report.results[lit.name]
    assert page.is_file() and page.is_relative_to(tmp_path)
    assert sentences[0].startswith("Within 30 s at 16 x 12 the least error is reached by")
    assert report.job is None and lit.render.engine != "LUCH"


def test_a_report_can_be_cancelled_while_blender_goes_on(lit: bpy.types.Scene) -> None:
    lit.luch.report_seconds = 120.0
    job = report.start(lit, lit.view_layers[0])
    while job.running and job.doing != "reference":
        time.sleep(0.05)
    asked = time.perf_counter()
    bpy.ops.luch.cancel_report()
    reason = report.end()
    assert time.perf_counter() - asked < 3.0  # with the end of an interpreter
    assert "ended before anything was measured" in reason and report.job is None


def test_the_panel_shows_progress_then_sentences(lit: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []

    class Layout(SimpleNamespace):
        def prop(self, owner: Any, name: str) -> None:
            assert name in owner.bl_rna.properties
            drawn.append(name)

        def label(self, text: str, icon: str) -> None:
            drawn.append(text)

        def progress(self, factor: float, text: str) -> None:
            drawn.append(text)

        def operator(self, name: str, **_: object) -> SimpleNamespace:
            drawn.append(name)
            return SimpleNamespace()

        def row(self, **_: object) -> Layout:
            return self

        column = row

    class Panel(SimpleNamespace):  # a panel's methods without Blender's own
        _draw_result = report.LUCH_RENDER_PT_report._draw_result

    def draw() -> list[str]:
        drawn.clear()
        report.LUCH_RENDER_PT_report.draw(Panel(layout=Layout()), bpy.context)
        return list(drawn)

    monkeypatch.setattr(report, "results", {})
    assert "luch.report" in draw() and "report_seconds" in drawn
    monkeypatch.setattr(report, "job", SimpleNamespace(fraction=0.5, doing="round 2: kd-tree", left_s=31.0))
    assert "round 2: kd-tree, 00:31 left" in draw() and "luch.cancel_report" in drawn
    monkeypatch.setattr(report, "job", None)
    monkeypatch.setattr(report, "results", {lit.name: (["One sentence."], Path("/tmp/report.html"))})
    assert "One sentence." in draw() and "wm.url_open" in drawn


def test_what_goes_wrong_is_told(lit: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report_job, "_python", lambda: "/nowhere/python")
    with pytest.raises(RuntimeError, match="nowhere"):
        bpy.ops.luch.report()

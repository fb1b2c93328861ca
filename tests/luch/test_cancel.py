"""A render that is told to stop while a batch of paths is under way: at once, and with whole samples alone."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from luch import core
from luch.render import Progress, render
from luch.scene import Scene
from support.endings import veils

SAMPLES = 8  # of a tile: a batch


def small(scene: Scene, width: int) -> Scene:
    """Tiles of 16 x 16 pixels in a row, whose Sample Count is kept."""
    scene.film = replace(scene.film, width=width, height=16, passes=["Combined", "Sample Count"])
    return scene


@pytest.mark.promise(4)
def test_a_batch_that_takes_long_ends_where_it_is_and_leaves_no_trace() -> None:
    renderer = core.render.Renderer(small(veils(count=100), 16))
    renderer.prepare()
    finished: list[bool] = []
    work = threading.Thread(target=lambda: finished.append(renderer.render(0, SAMPLES)))
    work.start()
    time.sleep(0.02)
    renderer.cancel()
    work.join()
    assert finished == [False]
    passes = renderer.passes()
    assert not passes["Sample Count"].any() and not passes["Combined"].any()
    assert renderer.stats()["paths"] == 0


@pytest.mark.promise(4)
def test_what_a_cancelled_render_has_drawn_is_what_it_would_have_drawn() -> None:
    scene = small(veils(count=30), 64)
    whole, cut = core.render.Renderer(scene), core.render.Renderer(scene)
    for renderer in (whole, cut):
        renderer.prepare()
    assert whole.render(0, SAMPLES)
    work = threading.Thread(target=lambda: cut.render(0, SAMPLES))
    work.start()
    while work.is_alive() and cut.step_progress() < 0.25:
        time.sleep(0.001)
    cut.cancel()
    work.join()
    counts = cut.passes()["Sample Count"][..., 0]
    drawn = counts == SAMPLES
    assert drawn.any() and not drawn.all() and not counts[~drawn].any()
    expected, found = whole.passes()["Combined"], cut.passes()["Combined"]
    assert np.array_equal(found[drawn], expected[drawn]) and not found[~drawn].any()


@pytest.mark.promise(4)
@pytest.mark.parametrize(("seconds_a_pixel", "looked"), [(1e-9, True), (1e-2, False)])
def test_who_cancels_does_not_wait_for_an_estimate_that_takes_long(
    monkeypatch: pytest.MonkeyPatch, seconds_a_pixel: float, looked: bool
) -> None:
    """At 3840 x 2160 pixels two processors took 3 s for it, after the no."""
    monkeypatch.setattr("luch.render.LOOK_SECONDS", seconds_a_pixel)
    monkeypatch.setattr("luch.render.LOOK_SHARE", 0.0)
    scene = small(veils(count=5), 64)
    scene.settings = replace(scene.settings, samples=1 << 16, estimate_error=True)

    def enough(progress: Progress) -> bool:
        return progress.preparing or progress.samples < 4

    result = render(scene, progress=enough)
    assert result.stats["stopped_by"] == "cancel" and result.stats["samples"] >= 4
    assert ("error" in result.stats) == looked

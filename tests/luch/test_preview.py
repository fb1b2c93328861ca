"""A preview: coarse at once, then finer; the scene that was submitted last wins; no thread is left behind."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from luch.preview import MOST_COARSE, Preview, coarser
from luch.render import Progress, Result, preparing, render
from luch.same import same
from luch.scene import Film, Scene
from support.everything import everything

WAIT_S = 60.0


def scene_of(width: int = 64, height: int = 48, samples: int = 4, **settings: object) -> Scene:
    scene = everything(**settings)
    scene.settings.samples, scene.settings.threads = samples, 0
    film = replace(scene.film, width=width, height=height, border=None, pixel_aspect=(1.0, 1.0), passes=["Combined"])
    return replace(scene, film=film)


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "luch preview"]


def test_the_finished_picture_is_what_a_render_gives() -> None:
    scene, preview = scene_of(), Preview()
    version = preview.submit(scene, "a view")
    assert preview.wait(WAIT_S) and preview.picture is not None
    assert (preview.picture.version, preview.picture.tag, preview.stats["samples"]) == (version, "a view", 4)
    assert np.array_equal(preview.picture.pixels, render(scene).passes["Combined"])
    assert not threads()


def test_the_first_picture_is_coarse_and_comes_before_all_samples() -> None:
    preview = Preview()
    preview.submit(scene_of(256, 192, samples=1 << 16))
    began = time.perf_counter()
    while preview.picture is None:
        assert time.perf_counter() - began < WAIT_S
        time.sleep(0.001)
    assert preview.picture.pixels.shape in [(48, 64, 4), (96, 128, 4)]
    while preview.picture.pixels.shape != (192, 256, 4):
        assert time.perf_counter() - began < WAIT_S
        time.sleep(0.001)
    preview.stop(wait=True)
    assert preview.picture is None and not threads()


def test_the_scene_submitted_last_is_drawn_and_a_stale_one_is_dropped_within_a_tenth_of_a_second() -> None:
    preview = Preview()
    long, last = scene_of(256, 192, samples=1 << 16), scene_of(32, 32, samples=2)
    for _ in range(30):
        preview.submit(long)
        time.sleep(0.01)
    waits = []
    for _ in range(5):
        preview.submit(long)
        time.sleep(0.1)
        version, began = preview.submit(last), time.perf_counter()
        while preview.picture is None or preview.picture.version != version:
            time.sleep(0.001)
        waits.append(time.perf_counter() - began)  # with the first picture of the other
    assert min(waits) < 0.1 and sorted(waits)[2] < 0.3, waits  # a loaded machine with two processors
    assert preview.wait(WAIT_S) and preview.picture is not None
    assert np.array_equal(preview.picture.pixels, render(last).passes["Combined"])


def test_the_words_are_of_the_view_that_is_shown() -> None:
    preview = Preview()
    preview.submit(scene_of(samples=4))
    assert preview.wait(WAIT_S) and preview.text == "4 samples"
    preview._pixel_seconds = 1.0  # as slow that the first picture is a coarse one
    version = preview.submit(scene_of(256, 192, samples=1 << 16))
    while preview.picture is None or preview.picture.version != version:
        time.sleep(0.0005)
    assert preview.text == "0 samples"
    preview.stop(wait=True)


def test_a_view_that_turns_without_pause_shows_pictures_and_builds_once() -> None:
    preview, scene = Preview(), scene_of(640, 480, samples=1 << 16)
    preview.submit(scene)
    while preview.picture is None:
        time.sleep(0.001)
    seen = set()
    for number in range(100):  # a mouse tells of a move more often than a picture comes
        matrix = scene.camera.matrix.copy()
        matrix[0, 3] += 0.01 * number
        preview.submit(replace(scene, camera=replace(scene.camera, matrix=matrix)))
        time.sleep(0.01)
        seen.add(preview.picture.version)
    preview.clear()
    assert preview.picture is None
    assert preview.wait(0.5) and preview.picture is None  # nothing of before comes back
    assert len(seen) >= 5 and preview.kept.builds == 1, seen
    assert preview.kept.origin is None  # nor is it kept


def test_a_view_that_turns_shows_pictures_where_the_finished_size_comes_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on a GPU: 30 ms a picture, whatever its size, and a move every 10 ms."""
    preview, scene = Preview(), scene_of(samples=1 << 16)

    def slow(scene: Scene, progress: Callable[[Progress], bool], **_: object) -> Result:
        began, samples = time.perf_counter(), 0
        total = scene.settings.samples
        while samples < total:
            until = time.perf_counter() + 0.03
            while time.perf_counter() < until:
                progress(replace(preparing(total, began), samples=samples))
                time.sleep(0.001)
            samples += 1
        pixels = np.zeros((scene.film.height, scene.film.width, 4), np.float32)
        took = time.perf_counter() - began
        return Result({"Combined": pixels}, {"total_seconds": took, "prepare_seconds": 0.0, "reused": True,
                                             "trace_seconds": took})  # fmt: skip

    monkeypatch.setattr("luch.preview.render", slow)
    preview._pixel_seconds = 1e-6
    seen = set()
    for _ in range(60):
        preview.submit(replace(scene))
        time.sleep(0.01)
        if preview.picture is not None:
            seen.add((preview.picture.version, preview.picture.film.width))
    preview.stop(wait=True)
    assert len(seen) >= 6 and {width for _, width in seen} == {64}, seen


@pytest.mark.parametrize(
    ("limits", "end"), [({"samples": 3}, "samples"), ({"time_limit": 0.3}, "time"), ({"error_limit": 0.2}, "error")]
)
def test_samples_seconds_and_error_end_it(limits: dict[str, float], end: str) -> None:
    preview = Preview()
    preview.submit(scene_of(**{"samples": 1 << 16, **limits}))
    assert preview.wait(WAIT_S) and preview.stats["stopped_by"] == end


def test_an_error_is_told_and_the_next_scene_is_drawn() -> None:
    preview = Preview(explain=lambda error: f"No: {error}")
    preview.submit(replace(scene_of(), film=Film(width=0)))
    assert preview.wait(WAIT_S)
    assert preview.failed and preview.text.startswith("No: ") and preview.picture is None
    preview.submit(scene_of())
    assert preview.wait(WAIT_S) and not preview.failed and preview.picture is not None


@pytest.mark.parametrize("factor", [2, 4, MOST_COARSE])
@pytest.mark.parametrize("border", [None, (11, 5, 90, 41)])
def test_coarser_films_see_the_same(factor: int, border: tuple[int, int, int, int] | None) -> None:
    fine = Film(width=101, height=67, border=border, pixel_aspect=(1.0, 1.25))
    coarse = coarser(fine, factor)
    assert coarse.width * coarse.pixel_aspect[0] == pytest.approx(101.0)
    assert coarse.height * coarse.pixel_aspect[1] == pytest.approx(67.0 * 1.25)
    if border is not None:
        assert coarse.border is not None
        edges = np.array(coarse.border) * np.tile([101 / coarse.width, 67 / coarse.height], 2)
        assert (edges[:2] <= border[:2] + np.full(2, 1e-9)).all() and (edges[2:] >= border[2:] - np.full(2, 1e-9)).all()


def test_same_tells_values_apart_wherever_they_differ() -> None:
    scene = scene_of()
    assert same(scene, scene_of())
    moved = scene_of()
    moved.camera.clip_end += 1.0
    assert not same(scene, moved)
    assert same([np.array([np.nan]), {"a": (1, 2)}], [np.array([np.nan]), {"a": (1, 2)}])
    for other in ([np.array([0.0]), {"a": (1, 2)}], [np.array([np.nan]), {"a": (1, 3)}], [np.array([np.nan])], None):
        assert not same([np.array([np.nan]), {"a": (1, 2)}], other)

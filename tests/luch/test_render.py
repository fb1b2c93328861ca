"""The loop over samples: what a caller is told, and how soon it can stop."""

from __future__ import annotations

import gc
import re
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import accuracy
from luch._native import core
from luch.accel import KINDS
from luch.cuda import device
from luch.render import Progress, render
from luch.scene import Camera, Film, Instances, Material, Mesh, Object, Scene, Settings
from luch.shader import ProgramBuilder


def heavy_scene(triangles: int) -> Scene:
    """So many small triangles that building takes much longer than the caller's first look."""
    rng = np.random.default_rng(5)
    corners = rng.uniform(-1, 1, (triangles, 1, 3)) + rng.normal(size=(triangles, 3, 3)) * 0.01
    mesh = Mesh(
        "Dust",
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * triangles, dtype=np.uint32).reshape(-1, 3),
        np.zeros(triangles, np.uint16),
    )
    here = np.eye(3, 4)[None]
    one = Instances(np.zeros(1, np.uint32), here, np.zeros(1, np.float32), np.zeros((1, 3), np.float32),
                    np.zeros((1, 2), np.float32))  # fmt: skip
    return Scene(
        name="Heavy",
        meshes=[mesh],
        objects=[Object("Dust", 0, [0])],
        instances=one,
        materials=[Material("Plain", ProgramBuilder().finish())],
        camera=Camera(),
        film=Film(width=16, height=16),
        settings=Settings(samples=4, threads=1),
    )


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "BVH"])
def test_the_structure_does_not_change_the_picture(kind: str) -> None:
    scenes = [heavy_scene(200) for _ in range(2)]
    scenes[1].settings.accelerator = kind
    truth, ours = (render(scene) for scene in scenes)
    assert ours.stats["accelerator"] == kind
    assert ours.stats["accelerator_reason"] == "chosen by the user"
    for name, image in truth.passes.items():
        assert np.array_equal(image.view(np.uint32), ours.passes[name].view(np.uint32)), name


def test_automatic_says_what_it_measured() -> None:
    stats = render(heavy_scene(40)).stats
    assert stats["accelerator"] in KINDS
    assert re.search(r"\d million trial rays .* against .* \d", stats["accelerator_reason"])
    large = render(heavy_scene(20_000)).stats
    assert large["accelerator"] == "BVH"
    assert re.search(
        r"KD_TREE untried: building it takes 0.05\d? s a thread, tracing about 0.0", large["accelerator_reason"]
    )


def test_a_trial_is_made_where_it_is_cheap_beside_the_render() -> None:
    def tried(samples: int, seconds: float) -> bool:
        scene = heavy_scene(20_000)
        scene.film.width = scene.film.height = 512
        scene.settings.samples, scene.settings.time_limit = samples, seconds
        renderer = core.render.Renderer(scene)
        assert renderer.prepare()
        reason = renderer.stats()["accelerator_reason"]
        assert "million trial rays" in reason, "what the tree does here is measured in any case"
        return "untried" not in reason

    assert tried(10_000, 0.0)
    assert not tried(10_000, 1.0), "a time limit bounds what there is to win"
    assert not tried(1, 0.0)


def test_an_unknown_structure_is_refused_by_name() -> None:
    scene = heavy_scene(1)
    scene.settings.accelerator = "OCTREE"
    with pytest.raises(ValueError, match=r'Structure "OCTREE" is not known; take one of AUTO, BVH, .*BRUTE_FORCE'):
        render(scene)


@pytest.mark.promise(4)
def test_a_cancel_while_structures_are_built_ends_the_building() -> None:
    told: list[Progress] = []

    def stop(progress: Progress) -> bool:
        told.append(progress)
        return False

    result = render(heavy_scene(1_500_000), progress=stop)
    assert result.cancelled
    assert [progress.preparing for progress in told] == [True]
    assert result.stats["samples"] == 0
    assert result.stats["structure_nodes"] == 0, "the tree was built to its end"
    assert not result.passes["Combined"].any()


def test_a_render_that_goes_on_is_told_of_building_then_of_samples() -> None:
    told: list[Progress] = []
    result = render(heavy_scene(300_000), progress=lambda progress: told.append(progress) is None)
    assert not result.cancelled
    assert result.stats["structure_nodes"] > 0
    kinds = [progress.preparing for progress in told]
    assert kinds == sorted(kinds, reverse=True)
    assert told[-1].samples == 4


def test_what_a_render_held_is_given_back_as_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not when Python next looks for cycles: a scene of some gigabytes would be there twice in the next frame."""
    ended: list[str] = []

    class Renderer(core.render.Renderer):
        def __del__(self) -> None:
            ended.append("given back")

    monkeypatch.setattr(core.render, "Renderer", Renderer)
    gc.collect()
    gc.disable()
    try:
        render(heavy_scene(200), progress=lambda told: True)
        assert ended == ["given back"]
    finally:
        gc.enable()


@pytest.mark.promise(5)
def test_without_a_gpu_the_cpu_goes_on_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cupy", None)  # as where it is not installed
    device.cupy.cache_clear()
    scene = heavy_scene(100)
    asked = replace(scene, settings=replace(scene.settings, device="CUDA"))
    result = render(asked)
    device.cupy.cache_clear()
    assert result.stats["device"] == "CPU"
    assert len(result.stats["warnings"]) == 1
    assert result.stats["warnings"][0].startswith("Rendered on the CPU: CUDA needs CuPy")
    assert np.array_equal(result.passes["Combined"], render(scene).passes["Combined"])


def test_an_unknown_device_is_refused_by_name() -> None:
    scene = heavy_scene(100)
    with pytest.raises(ValueError, match="'TPU'; it can be CPU or CUDA"):
        render(replace(scene, settings=replace(scene.settings, device="TPU")))


def test_a_time_limit_is_kept_with_building_and_reading_and_true_samples_are_told() -> None:
    """Research on other engines: 4 to 21 % over the limit, and the number asked for written as the number taken."""
    scene = heavy_scene(2_000)
    scene.film.width = scene.film.height = 96
    scene.film.passes = ["Combined", "Sample Count"]
    scene.settings = replace(scene.settings, samples=1 << 20, time_limit=0.6)
    began = time.perf_counter()
    result = render(scene)
    taken = time.perf_counter() - began
    assert 0.3 < taken <= 0.6 + 0.25  # 50 ms is the goal of the bench; other tests run beside this one
    counts = result.passes["Sample Count"]
    assert result.stats["stopped_by"] == "time" and result.stats["samples"] < result.stats["samples_asked"] == 1 << 20
    assert counts.min() >= result.stats["samples"] and counts.max() < 4 * result.stats["samples"]
    assert result.stats["total_seconds"] == pytest.approx(taken, abs=0.1)


def test_a_first_look_that_takes_long_puts_no_other_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first in a process touches new memory: it cost a small picture the looks after it, which took up to 4,096
    samples in place of 48. What a look took does not decide where the next one is.
    """
    plain = accuracy.estimate

    def looks(slow: bool) -> list[int]:
        taken: list[int] = []

        def estimate(*film: Any) -> Any:
            began = time.thread_time()
            while slow and not taken and time.thread_time() - began < 0.5:
                pass
            taken.append(len(taken))
            return plain(*film)

        monkeypatch.setattr(accuracy, "estimate", estimate)
        scene = heavy_scene(50)
        scene.settings = replace(scene.settings, error_limit=0.1, samples=1 << 12)
        result = render(scene)
        assert result.stats["stopped_by"] == "error"
        return [len(taken), result.stats["samples"]]

    at_once = looks(slow=False)
    assert at_once[0] >= 3 and looks(slow=True) == at_once


def test_whatever_error_is_asked_for_a_render_ends() -> None:
    scene = heavy_scene(50)
    for settings in (
        {"error_limit": 1e-9, "samples": 24},
        {"error_limit": 1e-9, "samples": 1 << 20, "time_limit": 0.2},
        {"error_limit": 0.5, "samples": 1 << 20},
        {"error_limit": 0.5, "samples": 1},
    ):
        result = render(replace(scene, settings=replace(scene.settings, **settings)))
        assert result.stats["stopped_by"] in ("samples", "time", "error")
        if "error" in result.stats:  # never without its brightness: metrics alone reward what loses light
            assert {"brightness", "brightness_low", "brightness_high", "fireflies_share"} <= set(result.stats)

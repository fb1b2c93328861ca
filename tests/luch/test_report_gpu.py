"""A report of a GPU, pretended here: renders that fill it, kernels that are compiled meanwhile."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.report import Report, schedule
from luch.report.plan import AS_SET, EXACT
from luch.report.schedule import TIMES_FULL, Session
from luch.report.shots import NotReady, Shot, _Clock
from luch.scene import Scene
from support.everything import everything

FILLS = 1 << 20  # paths
WAY = 0.02  # seconds of a step at least: the longest path's way, whatever the number of paths
PACE = 1e-7  # seconds a path where it is filled
GENERAL = 1.5  # times the seconds of a scene's own kernels
COSTS = {"indirect light": 0.25, "area lamps": 0.5}  # left out, in kernels that leave it out
LATE = 2  # shots of one scene until its own kernels are there


class Gpu:
    """In the place of luch.report.shots.shoot."""

    def __init__(self) -> None:
        self.shots: list[tuple[int, int]] = []  # pixels, samples
        self.waiting: set[str] = set()  # what would have been waited for
        self.asked: dict[str, int] = {}

    def __call__(self, scene: Scene, seed: int, samples: int, goes_on: Any, *, waits: bool = True, **_: Any) -> Shot:
        settings = scene.settings
        key = f"{settings.accelerator} {settings.precision} {settings.without_effects}"
        self.asked[key] = self.asked.get(key, 0) + 1
        own = self.asked[key] > LATE and settings.own_kernels
        if not own and settings.accelerator != "AUTO":  # which general kernels do not serve
            if not waits:
                raise NotReady
            self.waiting.add(settings.accelerator)
        cost = 1.0
        if own:
            for name in settings.without_effects:
                cost *= COSTS.get(name, 1.0)
        paths = scene.film.pixels * samples
        self.shots.append((scene.film.pixels, samples))
        rng = np.random.default_rng((seed, len(self.shots)))
        last = rng.normal(1.0, 0.01) * max(WAY, 0.5 * paths * PACE * cost * (1.0 if own else GENERAL))
        picture = np.full((scene.film.height, scene.film.width, 3), 0.5, np.float32)
        noise = rng.normal(0.0, 0.1 / samples**0.5, picture.shape)
        shot = Shot({samples: (picture + noise).astype(np.float32)}, trace_seconds=2.0 * last)
        shot.stats = {"device": "CUDA: pretended", "paths_to_fill": FILLS, "general_kernels": True,
                      "kernels_settled": own or not settings.own_kernels, "accelerator": "CWBVH", "triangles": 1000}  # fmt: skip
        return shot


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> Gpu:
    made = Gpu()
    monkeypatch.setattr(schedule, "shoot", made)
    return made


def report_of(rounds: int) -> Report:
    scene = everything()
    scene = replace(
        scene,
        film=replace(scene.film, width=96, height=64),
        settings=replace(scene.settings, device="CUDA", accelerator="AUTO", precision="WATERTIGHT"),
    )
    return Session(scene, 600.0, None, lambda variant: not variant.denoised, rounds=rounds).run()


def test_every_render_that_is_timed_fills_the_gpu(gpu: Gpu) -> None:
    """What little pictures take there is the length of a path's way."""
    report = report_of(rounds=5)
    assert len(gpu.shots) > 100
    assert min(pixels * samples for pixels, samples in gpu.shots[1:]) >= TIMES_FULL * FILLS
    base = report.row(AS_SET)
    assert base is not None
    assert base.sample_seconds / (report.width * report.height) == pytest.approx(PACE, rel=0.05)


def test_a_first_render_that_takes_long_does_not_tell_the_pace(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fills the GPU as little as one that is over at once."""
    monkeypatch.setitem(globals(), "WAY", 2.0 * schedule.PILOT_SECONDS)
    report_of(rounds=2)
    (pixels, samples), again = gpu.shots[:2]
    assert pixels * samples < FILLS and again[0] == pixels and pixels * again[1] >= TIMES_FULL * FILLS


def test_an_effect_is_priced_by_kernels_that_leave_it_out(gpu: Gpu) -> None:
    report = report_of(rounds=5)
    left_out = {row.effect: row.cost for row in report.effects}
    for name, cost in COSTS.items():
        assert left_out[name] == pytest.approx(cost, rel=0.1), name
    general = report.row("general kernels")
    assert general is not None and general.cost == pytest.approx(GENERAL, rel=0.1)


def test_one_render_by_an_effects_own_kernels_is_as_sure_as_the_others_are(gpu: Gpu) -> None:
    row = report_of(rounds=3).row("without indirect light")
    assert row is not None and row.cost == pytest.approx(COSTS["indirect light"], rel=0.1)
    assert row.cost_low < row.cost < row.cost_high < 1.1 * row.cost


def test_effects_whose_kernels_did_not_come_in_time_are_named(gpu: Gpu) -> None:
    report = report_of(rounds=2)
    assert not report.effects and "without indirect light" in report.unmeasured
    assert report.row("4 bounces") is not None, "it has the kernels of the scene as it is set"


def test_nobody_waits_for_kernels_but_those_of_the_scene_as_it_is_set(gpu: Gpu) -> None:
    report = report_of(rounds=5)
    assert not gpu.waiting and gpu.asked["KD_TREE WATERTIGHT []"] > LATE
    assert report.row("kd-tree") is not None and report.row("double precision") is not None
    assert {EXACT, AS_SET} <= {row.name for row in report.rows}


def test_a_gpu_is_timed_by_the_last_step_a_cpu_by_all() -> None:
    clock = _Clock()
    clock._ends = [(1, 10.0, 10.0), (2, 12.0, 12.0), (4, 13.0, 13.0)]  # samples, seconds
    assert clock.all_samples(late=True)[0] == pytest.approx(4 / 2 * 1.0)
    assert clock.all_samples(late=False)[0] == pytest.approx(4 / 3 * 3.0)

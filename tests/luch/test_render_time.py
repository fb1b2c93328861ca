"""The Render Time pass: where the time of a render went."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Scene
from support.everything import everything


def rendered(scene: Scene, *passes: str, **settings: object) -> Result:
    film = replace(scene.film, passes=["Combined", *passes])
    return render(replace(scene, film=film, settings=replace(scene.settings, **settings)))


def test_the_pass_adds_up_to_the_time_of_tracing() -> None:
    result = rendered(everything(), "Render Time", samples=64, threads=1)
    spent = 1e-3 * float(result.passes["Render Time"].sum(dtype=np.float64))
    assert spent == pytest.approx(result.stats["trace_seconds"], rel=0.05)


@pytest.mark.parametrize("threads", [1, 2])
def test_no_bit_of_the_other_passes_changes(threads: int) -> None:
    others = "Depth", "Normal", "Diffuse Direct", "Sample Count"
    without = rendered(everything(), *others, samples=16, threads=1)
    timed = rendered(everything(), *others, "Render Time", samples=16, threads=threads)
    for name, image in without.passes.items():
        assert np.array_equal(image.view(np.uint32), timed.passes[name].view(np.uint32)), name


def test_a_pixel_that_meets_nothing_takes_less_than_one_that_does() -> None:
    scene = everything()
    scene.camera.lens_mm = 9.0  # the floor's edges and what lies beyond
    result = rendered(scene, "Render Time", "Depth", samples=64, threads=1)
    sees_nothing = result.passes["Depth"][..., 0] > 1e9
    time = result.passes["Render Time"][..., 0]
    assert sees_nothing.any() and (time > 0.0).all()
    assert np.median(time[~sees_nothing]) > 2.0 * np.median(time[sees_nothing])


def test_it_costs_no_byte_where_it_is_not_asked_for() -> None:
    plain, timed = (rendered(everything(), *asked, samples=1) for asked in ((), ("Render Time",)))
    assert timed.stats["film_pixel_bytes"] - plain.stats["film_pixel_bytes"] == 8

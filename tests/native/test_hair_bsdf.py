"""Lobes of hair: what leaves a fibre that absorbs nothing, densities, pigments."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from support.fibres import sphere, view

Floats = NDArray[np.float64]
SAMPLES, ROWS, COLUMNS = 40_000, 16, 24


def fibre(**inputs: Any) -> Any:
    """Principled Hair along x, seen from 25 degrees off its normal plane and where h is not 0."""
    given = {"absorption": 0.0, "offset": 0.0349, "roughness": 0.3, "radial_roughness": 0.3, **inputs}
    return core.bsdf.Closures("principled_hair", given, **view(25.0, given.pop("lean", 30.0)))


@pytest.mark.parametrize("roughness", [0.15, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("lean", [0.0, 30.0, 80.0, -50.0])
def test_a_fibre_that_absorbs_nothing_sends_on_all_light(roughness: float, lean: float) -> None:
    c = fibre(roughness=roughness, radial_roughness=roughness, lean=lean)
    w, solid_angle = sphere()
    light, pdf = c.eval(w)
    assert (light.sum(axis=1)[:, 0] * solid_angle).sum() == pytest.approx(1.0, abs=3e-3)
    assert (pdf * solid_angle).sum() == pytest.approx(1.0, abs=3e-3)
    assert np.allclose(light.sum(axis=1)[:, 0], pdf, rtol=1e-4), "sampled in proportion: each sample sends on all"


@pytest.mark.parametrize("roughness", [1e-3, 0.02, 0.3, 1.0])
def test_samples_of_a_fibre_lose_nothing_however_sharp_it_is(roughness: float) -> None:
    c = fibre(roughness=roughness, radial_roughness=roughness, coat=0.5)
    drawn = c.sample(np.random.default_rng(1).random((2000, 3), dtype=np.float32))
    assert (drawn["pdf"] > 0.0).all() and np.isfinite(drawn["throughput"]).all()
    assert np.allclose(drawn["throughput"], 1.0, atol=1e-4)


@pytest.mark.parametrize(
    ("node", "name", "low", "high"),
    [("principled_hair", "roughness", 0.1, 1.0), ("principled_hair", "radial_roughness", 0.1, 1.0),
     ("principled_hair", "ior", 1.05, 2.0), ("hair", "roughness_along", 0.1, 1.0), ("hair", "roughness_around", 0.1, 1.0)],
)  # fmt: skip
def test_lobes_are_continuous(node: str, name: str, low: float, high: float) -> None:
    """What goes where, by first moments: an eighth of the step makes no change that is as large."""
    draws = np.random.default_rng(9).random((2048, 3), dtype=np.float32)

    def moments(value: float) -> Any:
        drawn = core.bsdf.Closures(node, {"absorption": (0.2, 0.5, 1.3), name: value} if "_" in node else {name: value},
                                   **view(20.0, 40.0)).sample(draws)  # fmt: skip
        light = drawn["throughput"].astype(float).mean(axis=1, keepdims=True)
        return np.concatenate([light, light * drawn["direction"]], axis=1).mean(axis=0)

    def largest(count: int) -> float:
        at = np.array([moments(float(value)) for value in np.linspace(low, high, count)])
        return float(np.abs(np.diff(at, axis=0)).max())

    coarse = largest(9)
    assert coarse > 1e-4, "nothing changes: the input is not read"
    assert largest(65) < max(0.4 * coarse, 4e-3)


def test_without_tilt_light_may_go_either_way_along_the_fibre() -> None:
    """The model's lobes along a fibre are symmetric; around it they depend on where the fibre is hit, so only directions
    in the plane of fibre and viewer, met in the middle, may be exchanged."""
    a, b = ((math.sin(t), 0.0, math.cos(t)) for t in (0.5, -0.2))
    n = (0.0, 0.0, 1.0)
    given = {"absorption": (0.2, 0.5, 1.3), "offset": 0.0}
    ab, ba = (
        core.bsdf.Closures("principled_hair", given, wo=x, n=n, ng=n).eval(np.array([y], np.float32))[0].sum(axis=1)[0]
        for x, y in ((a, b), (b, a))
    )
    # Attenuation is the viewer's: for angles that are nearly the same it hardly differs.
    assert np.allclose(ab, ba, rtol=0.05)


def test_pigments_darken_and_redden() -> None:
    w, solid_angle = sphere(64, 128)

    def color(**inputs: Any) -> Any:
        return (fibre(pigments=True, **inputs).eval(w)[0].sum(axis=1) * solid_angle[:, None]).sum(axis=0)

    light, dark = color(melanin=0.2, melanin_redness=0.0), color(melanin=0.9, melanin_redness=0.0)
    assert (dark < light).all() and dark[0] > dark[1] > dark[2]
    red = color(melanin=0.5, melanin_redness=1.0)
    brown = color(melanin=0.5, melanin_redness=0.0)
    assert red[0] / red[2] > brown[0] / brown[2]


def test_what_is_no_number_is_no_light() -> None:
    for inputs in ({"ior": 0.0}, {"ior": 1.0}, {"absorption": 1e30}, {"roughness": 0.0, "radial_roughness": 0.0}):
        c = fibre(**inputs)
        light, pdf = c.eval(sphere(16, 32)[0])
        assert np.isfinite(light).all() and np.isfinite(pdf).all() and (light >= 0.0).all()

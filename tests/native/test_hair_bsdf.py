"""Lobes of hair: what leaves a fibre that absorbs nothing, densities, pigments."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from scipy import stats

Floats = NDArray[np.float64]
SAMPLES, ROWS, COLUMNS = 40_000, 16, 24


def fibre(**inputs: Any) -> Any:
    """Principled Hair along x, seen from 25 degrees off its normal plane and where h is not 0."""
    given = {"absorption": 0.0, "offset": 0.0349, "roughness": 0.3, "radial_roughness": 0.3, **inputs}
    return core.bsdf.Closures("principled_hair", given, **view(25.0, given.pop("lean", 30.0)))


def view(degrees: float, lean: float) -> dict[str, Any]:
    a, b = math.radians(degrees), math.radians(lean)
    normal = (0.0, 0.0, 1.0)
    wo = (math.sin(a), math.cos(a) * math.sin(b), math.cos(a) * math.cos(b))
    return {"wo": wo, "n": normal, "ng": normal}


def sphere(rows: int = 192, columns: int = 384) -> tuple[Any, Any]:
    """Directions at equal angles from the axis x, which is the fibre's, and around it; the solid angle of each."""
    theta = ((np.arange(rows) + 0.5) / rows - 0.5) * np.pi
    phi = (np.arange(columns) + 0.5) / columns * 2.0 * np.pi
    gt, gp = np.meshgrid(theta, phi, indexing="ij")
    w = np.stack([np.sin(gt), np.cos(gt) * np.cos(gp), np.cos(gt) * np.sin(gp)], -1).reshape(-1, 3)
    return w.astype(np.float32), (np.cos(gt) * np.pi / rows * 2.0 * np.pi / columns).ravel()


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


LOBES: dict[str, tuple[str, dict[str, Any]]] = {
    "fibre": ("principled_hair", {"absorption": (0.2, 0.5, 1.3)}),
    "rough fibre": ("principled_hair", {"roughness": 0.7, "radial_roughness": 0.8, "coat": 0.6, "pigments": True}),
    "tilted fibre": ("principled_hair", {"offset": 0.2, "ior": 1.3, "roughness": 0.4, "radial_roughness": 0.5}),
    "reflection": ("hair", {"offset": 0.1, "roughness_along": 0.3, "roughness_around": 0.6}),
    "transmission": ("hair", {"transmission": True, "roughness_along": 0.4, "roughness_around": 0.5}),
}


@pytest.mark.parametrize("lean", [5.0, 70.0])
@pytest.mark.parametrize("degrees", [0.0, 40.0])
@pytest.mark.parametrize("name", LOBES)
def test_samples_follow_their_density(name: str, degrees: float, lean: float) -> None:
    node, inputs = LOBES[name]
    c = core.bsdf.Closures(node, inputs, **view(degrees, lean))
    drawn = c.sample(np.random.default_rng(7).random((SAMPLES, 3), dtype=np.float32))
    fine = 12
    w, solid_angle = sphere(ROWS * fine, COLUMNS * fine)
    mass = (c.eval(w)[1].astype(float) * solid_angle).reshape(ROWS, fine, COLUMNS, fine)
    expected = mass.sum(axis=(1, 3)).ravel() * SAMPLES
    d = drawn["direction"][drawn["pdf"] > 0.0]
    row = np.clip(((np.arcsin(np.clip(d[:, 0], -1.0, 1.0)) / np.pi + 0.5) * ROWS).astype(int), 0, ROWS - 1)
    column = (np.arctan2(d[:, 2], d[:, 1]) / (2.0 * np.pi) % 1.0 * COLUMNS).astype(int) % COLUMNS
    observed = np.bincount(row * COLUMNS + column, minlength=ROWS * COLUMNS)
    expected = np.append(expected, max(SAMPLES - expected.sum(), 0.0))  # draws that found no direction
    observed = np.append(observed, SAMPLES - observed.sum())
    order = np.argsort(expected)
    expected, observed = expected[order], observed[order]
    small = int(np.searchsorted(expected, 10.0))
    expected = np.append(expected[small:], expected[:small].sum())
    observed = np.append(observed[small:], observed[:small].sum())
    slack = 0.01 * expected + 0.004 * SAMPLES / len(expected)  # of the midpoint rule
    chi2 = float((np.maximum(np.abs(observed - expected) - slack, 0.0) ** 2 / np.maximum(expected, 1.0)).sum())
    assert stats.chi2.sf(chi2, len(expected) - 1) > 0.01 / 20, (chi2, len(expected))


@pytest.mark.parametrize("name", LOBES)
def test_sampling_and_evaluation_agree(name: str) -> None:
    node, inputs = LOBES[name]
    c = core.bsdf.Closures(node, inputs, **view(20.0, 40.0))
    drawn = c.sample(np.random.default_rng(8).random((3000, 3), dtype=np.float32))
    kept = drawn["pdf"] > 1e-3
    light, pdf = c.eval(drawn["direction"][kept])
    assert np.quantile(np.abs(pdf / drawn["pdf"][kept] - 1.0), 0.98) < 5e-3
    assert np.quantile(np.abs(light.sum(axis=1) / pdf[:, None] - drawn["throughput"][kept]), 0.98) < 5e-3


@pytest.mark.parametrize(
    ("node", "name", "low", "high"),
    [("principled_hair", "roughness", 0.1, 1.0), ("principled_hair", "radial_roughness", 0.1, 1.0),
     ("principled_hair", "ior", 1.05, 2.0), ("hair", "roughness_along", 0.1, 1.0), ("hair", "roughness_around", 0.1, 1.0)],
)  # fmt: skip
def test_lobes_are_continuous(node: str, name: str, low: float, high: float) -> None:
    """What goes where, by first moments: an eighth of the step makes no change that is as large."""
    draws = np.random.default_rng(9).random((2048, 3), dtype=np.float32)

    def moments(value: float) -> Any:
        drawn = core.bsdf.Closures(node, {**LOBES["fibre"][1], name: value} if "_" in node else {name: value},
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

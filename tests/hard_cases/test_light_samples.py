"""Samples of lamps, worlds and emissive triangles follow their density, and a triangle's light is Lambert's. Numbers: the
rows of the list of hard cases.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from scipy import stats
from support.lights import (
    LAMP,
    LAMPS,
    TRIANGLE,
    TURN,
    cone_directions,
    contributions,
    mesh_light,
    numbers,
    polygon_irradiance,
    rows,
    sphere_directions,
    store,
)

ORIGIN = (0.0, 0.0, 0.0)
UP, SLANTED, NONE = (0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (0.0, 0.0, 0.0)
COUNT = 1 << 15
TESTS = 20  # of worlds and triangles: Sidak's level for them all


def differs(observed: NDArray[Any], expected: NDArray[Any], slack: float) -> float:
    """p of the chi-square test. slack: of the expected counts, for the quadrature that they come from."""
    wide = expected > 10.0
    observed = np.append(observed[wide], observed[~wide].sum()).astype(float)
    expected = np.append(expected[wide], expected[~wide].sum())
    excess = np.maximum(np.abs(observed - expected) - slack * expected - 1e-4 * COUNT, 0.0)
    return float(stats.chi2.sf((excess**2 / np.maximum(expected, 1.0)).sum(), len(expected) - 1))


def bins(d: NDArray[Any]) -> NDArray[np.int64]:
    """Of directions: eight belts of one area, each in sixteen."""
    belt = np.clip(((d[:, 2] + 1.0) * 4.0).astype(int), 0, 7)
    turn = np.arctan2(d[:, 1], d[:, 0]) / (2.0 * math.pi) % 1.0
    return belt * 16 + np.minimum((turn * 16.0).astype(int), 15)


PICTURE = np.random.default_rng(2).uniform(0.0, 1.0, (16, 32, 3)).astype(np.float32)
PICTURE[3, 31] = 40.0
SUN = {"has_sun": True, "sun_direction": [0.6, 0.0, 0.8], "sun_angle": 0.6, "sun_radiance": [20.0] * 3}
WORLDS: dict[str, dict[str, Any]] = {
    "map": {"map": PICTURE},
    "map of one row": {"map": PICTURE[3:4]},
    "even": {"radiance": [1.0, 1.0, 1.0]},
    "map with a sun": {"map": PICTURE, **SUN},
    "even with a sun": {"radiance": [1.0, 1.0, 1.0], **SUN},
}


@pytest.mark.parametrize("normal", [UP, SLANTED, NONE], ids=["up", "slanted", "in a volume"])
@pytest.mark.parametrize("name", WORLDS)
def test_41_samples_of_a_world_follow_their_density(name: str, normal: tuple[float, float, float]) -> None:
    lights = core.light.TestLights(world=WORLDS[name])
    d = sphere_directions(1 << 18)
    pdf = lights.pdf_world(rows(NONE, len(d)), rows(normal, len(d)), False, d).astype(float)
    expected = np.bincount(bins(d), weights=pdf, minlength=128) * 4.0 * math.pi / len(d) * COUNT
    draws = np.random.default_rng(43).random((COUNT, 3), dtype=np.float32)
    s = lights.sample(rows(NONE, COUNT), rows(normal, COUNT), False, draws)
    assert expected.sum() == pytest.approx(COUNT, rel=5e-3)
    assert differs(np.bincount(bins(s["direction"]), minlength=128), expected, 0.01) > 0.01 / TESTS


CORNERS = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [0.0, 1.5, 1.0]])
PLACES = {"below": (0.2, 0.1, 0.0), "near": (0.2, 0.1, 0.8), "all but in it": (0.1, 0.1, 0.999), "askew": (4.0, 1.0, 0.5),
          "far": (-30.0, 0.0, 0.0)}  # fmt: skip


@pytest.mark.parametrize("name", PLACES)
def test_41_samples_of_a_triangle_follow_their_density(name: str) -> None:
    """Over 8 x 8 cells of its barycentric coordinates."""
    p, lights = PLACES[name], mesh_light(CORNERS)
    draws = np.random.default_rng(44).random((COUNT, 3), dtype=np.float32)
    s = lights.sample(rows(p, COUNT), rows(UP, COUNT), False, draws)
    fine = (np.stack(np.meshgrid(np.arange(480), np.arange(480)), -1).reshape(-1, 2) + 0.5) / 480.0
    fine = fine[fine.sum(1) < 1.0]
    points = CORNERS[0] + fine[:, :1] * (CORNERS[1] - CORNERS[0]) + fine[:, 1:] * (CORNERS[2] - CORNERS[0])
    along = points - np.array(p)
    distance = np.linalg.norm(along, axis=1)
    direction, zeros = (along / distance[:, None]).astype(np.float32), np.zeros(len(fine), np.uint32)
    pdf = lights.pdf_triangle(rows(p, len(fine)), rows(UP, len(fine)), False, zeros, zeros, direction, distance)
    mass = pdf.astype(float) * direction[:, 2] / distance**2
    cell = (fine * 8.0).astype(int)
    expected = np.bincount(cell[:, 0] * 8 + cell[:, 1], weights=mass, minlength=64)
    found = np.clip((s["uv"] * 8.0).astype(int), 0, 7)[s["kind"] != 0]
    observed = np.bincount(found[:, 0] * 8 + found[:, 1], minlength=64)
    assert len(found) > 0.99 * COUNT
    assert differs(observed, expected / expected.sum() * len(found), 0.01) > 0.01 / TESTS


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS.keys())
def test_41_samples_of_a_lamp_follow_their_density(lamp: dict[str, Any]) -> None:
    """Chi-square over bins of the cone that holds the lamp."""
    lights = store(lamp | {"matrix": TURN})
    shines = np.array([0.48, -0.6, -0.64])  # TURN's -z
    p, n = np.array([0.3, -0.2, 1.5]) + 1.2 * shines + [0.1, 0.2, 0.05], -shines
    count, rows_of_bins, columns = 1 << 14, 6, 8
    draws = np.random.default_rng(41).random((count, 3), dtype=np.float32)
    s = lights.sample(rows(p, count), rows(n, count), False, draws)
    drawn = s["direction"][s["kind"] == LAMP].astype(float)
    mean = drawn.mean(0)
    axis = mean / np.linalg.norm(mean)
    gap = min(2.0, 1.1 * float(1.0 - (drawn @ axis).min()))
    d = cone_directions(axis, gap, 1 << 17)
    h = lights.hit(rows(p, len(d)), rows(n, len(d)), False, d, sun=0 if lamp["shape"] == "SUN" else -1)
    lit = (h["lamp"] == 0) & (h["radiance"][:, 0] > 0)
    mass = np.where(lit, h["pdf"].astype(float), 0.0) * 2 * math.pi * gap / len(d) * count
    x = np.cross(axis, [0.3, 0.9, -0.1])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)

    def bins(direction: Any) -> Any:
        row = np.clip(((1.0 - direction @ axis) / gap * rows_of_bins).astype(int), 0, rows_of_bins - 1)
        turn = np.arctan2(direction @ y, direction @ x) / (2.0 * math.pi) % 1.0
        return row * columns + np.minimum((turn * columns).astype(int), columns - 1)

    expected = np.bincount(bins(d.astype(float)), weights=mass, minlength=rows_of_bins * columns)
    observed = np.bincount(bins(drawn), minlength=rows_of_bins * columns).astype(float)
    expected = np.append(expected, max(count - expected.sum(), 0.0))  # draws that found no light
    observed = np.append(observed, count - len(drawn))
    wide = expected > 10.0
    slack = 0.006 * expected + 0.0005 * count  # of the quadrature, at the lamp's rim above all
    excess = np.maximum(np.abs(observed - expected) - slack, 0.0)[wide]
    chi2 = float((excess**2 / expected[wide]).sum())
    assert stats.chi2.sf(chi2, wide.sum() - 1) > 0.01 / len(LAMPS), (chi2, wide.sum())
    assert observed[~wide].sum() <= expected[~wide].sum() + 0.004 * count


@pytest.mark.parametrize("p", [(0.2, 0.1, 0.0), (0.2, 0.1, 0.8), (4.0, 1.0, 0.5), (-30.0, 0.0, 0.0)])
def test_41_triangle_samples_are_uniform_in_their_density(p: tuple[float, float, float]) -> None:
    """Counts of samples in sixteen equal-area cells of the triangle against the integral of the density."""
    corners = np.array([[-1, -1, 1], [1, -1, 1], [0, 1.5, 1]], float)
    lights = mesh_light(corners)
    count = 1 << 14
    s = lights.sample(rows(p, count), rows(UP, count), False, numbers(count))
    assert (s["kind"] == TRIANGLE).all()
    cells = np.floor(np.clip(s["uv"], 0, 0.9999) * 4).astype(int)
    drawn = np.bincount(cells[:, 0] * 4 + cells[:, 1], minlength=16) / count
    fine = (np.stack(np.meshgrid(np.arange(400), np.arange(400)), -1).reshape(-1, 2) + 0.5) / 400
    fine = fine[fine.sum(1) < 1]
    points = corners[0] + fine[:, :1] * (corners[1] - corners[0]) + fine[:, 1:] * (corners[2] - corners[0])
    along = points - np.array(p)
    distance = np.linalg.norm(along, axis=1)
    direction = (along / distance[:, None]).astype(np.float32)
    zeros = np.zeros(len(fine), np.uint32)
    pdf = lights.pdf_triangle(rows(p, len(fine)), rows(UP, len(fine)), False, zeros, zeros, direction, distance)
    mass = pdf * direction[:, 2] / distance**2  # steradians to area: all cells are alike
    at = np.floor(fine * 4).astype(int)
    expected = np.bincount(at[:, 0] * 4 + at[:, 1], weights=mass, minlength=16)
    np.testing.assert_allclose(drawn, expected / expected.sum(), atol=4e-3)
    area = 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    assert mass.mean() * area == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("normal", [UP, ORIGIN])
@pytest.mark.parametrize("transmits", [False, True])
@pytest.mark.parametrize("sun", [False, True])
def test_41_world_density_integrates_to_one_and_is_that_of_its_samples(normal: Any, transmits: bool, sun: bool) -> None:
    rng = np.random.default_rng(2)
    picture = rng.uniform(0, 1, (16, 32, 3)).astype(np.float32)
    picture[3, 31] = 40.0
    extra = {"has_sun": sun, "sun_direction": [0.6, 0.0, 0.8], "sun_angle": 0.3, "sun_radiance": [20.0] * 3}
    for world in ({"map": picture}, {"radiance": [1.0, 1.0, 1.0]}):
        lights = core.light.TestLights(world=world | extra)
        d = sphere_directions(1 << 17)
        pdf = lights.pdf_world(rows(ORIGIN, len(d)), rows(normal, len(d)), transmits, d)
        assert pdf.mean() * 4 * math.pi == pytest.approx(1.0, abs=3e-3)
        count = 1 << 14
        s = lights.sample(rows(ORIGIN, count), rows(normal, count), transmits, numbers(count))
        again = lights.pdf_world(rows(ORIGIN, count), rows(normal, count), transmits, s["direction"])
        np.testing.assert_allclose(again, s["pdf"], rtol=2e-3)
        moment = (pdf.astype(float)[:, None] * 4 * math.pi * d).mean(0)
        np.testing.assert_allclose(s["direction"].mean(0), moment, atol=4e-3)


@pytest.mark.parametrize("edge", [1e-3, 1e-2, 0.1, 1.0, 30.0, 1e3])
@pytest.mark.parametrize("height", [1e-3, 0.1, 1.0, 10.0])
def test_50_triangle_light_gives_lamberts_polygon_formula(edge: float, height: float) -> None:
    h = height * edge
    corners = np.array([[-edge / 2, -edge / 3, h], [edge / 2, -edge / 3, h], [0.1 * edge, edge / 2, h]])
    truth = polygon_irradiance(corners, ORIGIN, UP)
    estimate = contributions(mesh_light(corners), ORIGIN, UP, 1 << 15)
    assert estimate.mean() == pytest.approx(truth, rel=2e-4)
    assert estimate.std() < 1.2 * truth


def test_50_noise_of_a_triangle_light_does_not_depend_on_scale() -> None:
    shape = np.array([[-1, -0.5, 0.8], [0.9, -0.4, 0.8], [0.1, 0.7, 0.8]])
    noise = [contributions(mesh_light(shape * s), ORIGIN, UP).std() for s in (1e-3, 1.0, 1e3)]
    assert max(noise) / min(noise) < 1.01

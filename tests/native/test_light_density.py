"""Samples of worlds and of emissive triangles follow their density: chi-square, as for lamps (test_light_lamps)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from scipy import stats

from tests.support.lights import mesh_light, rows, sphere_directions

UP, SLANTED, NONE = (0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (0.0, 0.0, 0.0)
COUNT = 1 << 15
TESTS = 20  # of this file: Sidak's level for them all


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
def test_samples_of_a_world_follow_their_density(name: str, normal: tuple[float, float, float]) -> None:
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
def test_samples_of_a_triangle_follow_their_density(name: str) -> None:
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

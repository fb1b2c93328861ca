"""The lecture's two triangle tests and the watertight one agree with the double-precision test away from edges."""

from __future__ import annotations

import numpy as np
import pytest
from luch._native import core
from numpy.typing import NDArray
from support.accel_meshes import F32, rows

COUNT = 20_000
TESTS = ("plane", "barycentric", "watertight")


def well_shaped(seed: int = 1) -> tuple[F32, F32, NDArray[np.float64]]:
    """Rays, corners (N, 9) of triangles of size about 1, and the weights (N, 3) of the points that the rays aim at."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (COUNT, 3, 3))
    weights = rng.uniform(-0.5, 1.5, (COUNT, 3))
    weights[:, 0] = 1 - weights[:, 1] - weights[:, 2]
    target = (corners * weights[..., None]).sum(1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    direction = rng.normal(size=(COUNT, 3))
    slant = np.abs((normal * direction).sum(1)) / (area * np.linalg.norm(direction, axis=1))
    kept = (area > 0.2) & (slant > 0.1)
    rays = rows((target - 2 * direction)[kept], direction[kept])
    return rays, corners[kept].reshape(-1, 9).astype(np.float32), weights[kept]


@pytest.mark.parametrize("name", TESTS)
def test_agrees_with_the_double_test_away_from_edges(name: str) -> None:
    rays, corners, weights = well_shaped()
    inside, outside = (weights > 1e-4).all(1), (weights < -1e-4).any(1)
    truth, found = core.test_triangles("double", rays, corners), core.test_triangles(name, rays, corners)
    assert int(inside.sum()) > 1000 and int(outside.sum()) > 5000
    assert np.isfinite(truth[inside, 0]).all() and np.isfinite(found[inside, 0]).all()
    assert np.isinf(truth[outside, 0]).all() and np.isinf(found[outside, 0]).all()
    worst = np.abs(found[inside] - truth[inside]).max(0)
    assert (worst <= 5e-5).all(), worst  # of t about 2, u, v: the plane test 3.0e-5 in v, from 10 away


@pytest.mark.parametrize("name", (*TESTS, "double"))
def test_interval_is_open_below_and_closed_above(name: str) -> None:
    corners = np.tile(np.float32([[-9, -9, 2, 9, -9, 2, 0, 9, 2]]), (4, 1))
    rays = np.concatenate([rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), lo, hi)
                           for lo, hi in ((0, 2), (2, 9), (0, 1.9999999), (1.9999999, 9))])  # fmt: skip
    assert list(np.isfinite(core.test_triangles(name, rays, corners)[:, 0])) == [True, False, False, True]


@pytest.mark.parametrize("name", (*TESTS, "double"))
def test_triangles_without_area_and_rays_in_the_plane_miss(name: str) -> None:
    point, line = np.float32([1, 1, 1] * 3), np.float32([0, 0, 0, 1, 1, 1, 2, 2, 2])
    flat = np.float32([-1, -1, 0, 1, -1, 0, 0, 1, 0])
    origin, direction = np.zeros((3, 3)), np.array([[1, 1, 1.0], [1, 1, 1], [1, 0, 0]])
    found = core.test_triangles(name, rows(origin - 3 * direction, direction), np.stack([point, line, flat]))
    assert np.isinf(found[:, 0]).all()


def test_unknown_names_and_shapes_raise_one_clear_error() -> None:
    rays, corners, _ = well_shaped()
    with pytest.raises(ValueError, match="No triangle test is called 'sphere'"):
        core.test_triangles("sphere", rays, corners)
    with pytest.raises(ValueError, match=r"corners \(N, 9\)"):
        core.test_triangles("plane", rays, corners[:1])

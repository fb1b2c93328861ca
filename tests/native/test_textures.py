"""Texture operations: what must hold whatever Blender draws (agreement with Cycles: tests/addon)."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray

F32 = NDArray[np.float32]
run = core.textures.run
OPERATIONS: dict[str, tuple[int, int, int]] = core.textures.operations()
FROM_TABLES = {"IMAGE", "IMAGE_BOX", "ENVIRONMENT", "IES", "BLACKBODY", "WAVELENGTH", "SKY_ATMOSPHERE", "SKY_PREETHAM"}
PROCEDURAL = sorted(set(OPERATIONS) - FROM_TABLES)


def inputs_of(name: str, count: int, seed: int = 1, reach: float = 20.0) -> F32:
    """Points in [-reach, reach]^3, the other inputs in a range that means something to every operation."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(0.1, 2.0, (OPERATIONS[name][0], count))
    rows[:3] = rng.uniform(-reach, reach, (3, count))
    return rows.astype(np.float32)


def params_of(name: str) -> list[int]:
    if name == "BRICK":
        half = int(np.float32(0.5).view(np.uint32))
        return [half, 2, half, 3]
    return [1] * OPERATIONS[name][2]


@pytest.mark.parametrize("name", PROCEDURAL)
def test_chunks_of_lanes_give_the_scalar_values(name: str) -> None:
    inputs = inputs_of(name, 203)  # not a multiple of any pack
    chunked = run(name, inputs, params_of(name))
    scalar = run(name, inputs, params_of(name), one_by_one=True)
    np.testing.assert_allclose(chunked, scalar, rtol=1e-5, atol=1e-5)
    assert np.ptp(chunked[0]) > 0, "a constant texture proves nothing"


@pytest.mark.parametrize("name", PROCEDURAL)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-40, 0.0])
def test_no_coordinate_gives_a_colour_that_is_not_finite(name: str, bad: float) -> None:
    inputs = inputs_of(name, 70)
    inputs[:3] = bad
    assert np.isfinite(run(name, inputs, params_of(name))).all()


@pytest.mark.parametrize("name", [n for n in PROCEDURAL if not n.startswith(("CHECKER", "WHITE_NOISE"))])
def test_no_setting_gives_a_colour_that_is_not_finite(name: str) -> None:
    for bad in (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e30):
        for row in range(3, OPERATIONS[name][0]):
            inputs = inputs_of(name, 33)
            if name == "BRICK" and row < 12:
                continue  # colours pass through
            inputs[row] = bad
            assert np.isfinite(run(name, inputs, params_of(name))).all(), f"input {row} = {bad}"


def noise_inputs(points: F32, **settings: float) -> F32:
    values = {"w": 0.3, "scale": 1.0, "detail": 0.0, "roughness": 0.5, "lacunarity": 2.0, "offset": 0.0, "gain": 1.0}
    values |= {"distortion": 0.0} | settings
    rows = np.empty((11, points.shape[1]), np.float32)
    rows[:3] = points
    rows[3:] = np.array(list(values.values()), np.float32)[:, None]
    return rows


@pytest.mark.parametrize("dimensions", [2, 3])
def test_noise_is_one_half_on_the_lattice(dimensions: int) -> None:
    lattice = np.stack(np.meshgrid(*[np.arange(-4, 4)] * 3)).reshape(3, -1).astype(np.float32)
    value = run(f"NOISE_{dimensions}D", noise_inputs(lattice), [1, 1])[0]
    assert np.all(value == 0.5)


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
@pytest.mark.parametrize("detail", [0.0, 3.5, 15.0])
def test_normalized_noise_stays_between_zero_and_one(dimensions: int, detail: float) -> None:
    points = np.random.default_rng(2).uniform(-1000, 1000, (3, 4096)).astype(np.float32)
    rows = noise_inputs(points, detail=detail)
    rows[3] = points[0]
    value = run(f"NOISE_{dimensions}D", rows, [1, 1])[0]
    assert value.min() >= 0.0 and value.max() <= 1.0 and abs(value.mean() - 0.5) < 0.02


def test_noise_is_continuous_across_cells() -> None:
    points = np.zeros((3, 400), np.float32)
    points[0] = np.repeat(np.arange(-100, 100), 2) + np.tile([-1e-4, 1e-4], 200)
    points[1:] = 0.37
    value = run("NOISE_3D", noise_inputs(points, detail=2.0), [1, 1])[0]
    assert np.abs(value[0::2] - value[1::2]).max() < 5e-3


def test_lanes_with_different_detail_do_not_disturb_each_other() -> None:
    points = np.random.default_rng(3).uniform(-5, 5, (3, 64)).astype(np.float32)
    for kind in range(5):
        rows = noise_inputs(points, offset=0.6)
        rows[5] = np.linspace(0, 7, 64, dtype=np.float32)
        mixed = run("NOISE_3D", rows, [kind, 1])[0]
        alone = [run("NOISE_3D", rows[:, k : k + 1], [kind, 1])[0, 0] for k in range(64)]
        assert np.array_equal(mixed, np.array(alone, np.float32))


def voronoi_inputs(points: F32, randomness: float = 1.0) -> F32:
    rows = np.empty((11, points.shape[1]), np.float32)
    rows[:3] = points
    rows[3:] = np.array([0.0, 1.0, 0.0, 0.5, 2.0, 0.5, 0.5, randomness], np.float32)[:, None]
    return rows


def test_voronoi_distance_is_the_distance_to_its_position() -> None:
    points = np.random.default_rng(4).uniform(-9, 9, (3, 500)).astype(np.float32)
    for feature in (0, 1):
        out = run("VORONOI_3D", voronoi_inputs(points), [feature, 0, 0])
        np.testing.assert_allclose(np.linalg.norm(out[4:7] - points, axis=0), out[0], atol=3e-6)


def test_voronoi_f2_is_never_nearer_than_f1() -> None:
    points = np.random.default_rng(5).uniform(-9, 9, (3, 2000)).astype(np.float32)
    for metric in range(4):
        first = run("VORONOI_3D", voronoi_inputs(points), [0, metric, 0])[0]
        second = run("VORONOI_3D", voronoi_inputs(points), [1, metric, 0])[0]
        assert np.all(first <= second)


def test_voronoi_without_randomness_is_the_lattice() -> None:
    points = np.random.default_rng(6).uniform(-3, 3, (3, 300)).astype(np.float32)
    out = run("VORONOI_3D", voronoi_inputs(points, randomness=0.0), [0, 0, 0])
    np.testing.assert_allclose(out[4:7], np.round(points), atol=1e-6)


def test_distance_to_edge_is_zero_half_way_between_two_points() -> None:
    points = np.random.default_rng(7).uniform(-9, 9, (3, 300)).astype(np.float32)
    rows = voronoi_inputs(points)
    near, far = (run("VORONOI_3D", rows, [feature, 0, 0]) for feature in (0, 1))
    edge = run("VORONOI_EDGE_3D", rows, [0])[0]
    # The bisector plane of the two nearest points bounds the distance from above.
    gap = far[4:7] - near[4:7]
    bisector = np.sum(((near[4:7] + far[4:7]) / 2 - points) * gap, 0) / np.linalg.norm(gap, axis=0)
    assert np.all(edge <= bisector + 1e-5) and np.all(edge >= -1e-6)
    np.testing.assert_allclose(edge.min(), bisector[np.argmin(edge)], atol=1e-5)


def test_checker_alternates_between_neighbours() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(-5, 5) + 0.5] * 3)).reshape(3, -1).astype(np.float32)
    rows = np.concatenate([grid, np.tile(np.array([[1, 0, 0, 0, 1, 0, 1]], np.float32).T, grid.shape[1])])
    factor = run("CHECKER", rows)[3]
    assert np.array_equal(factor, np.floor(grid).sum(0) % 2)


def test_white_noise_is_uniform() -> None:
    points = np.random.default_rng(8).uniform(-1, 1, (4, 20000)).astype(np.float32)
    for dimensions in (1, 2, 3, 4):
        out = run(f"WHITE_NOISE_{dimensions}D", points)
        counts = np.apply_along_axis(lambda v: np.histogram(v, 10, (0, 1))[0], 1, out)
        assert counts.min() > 1800 and counts.max() < 2200

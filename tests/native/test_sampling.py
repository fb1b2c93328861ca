"""Properties of the sampler and of the warps of the unit square."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from scipy import stats
from support.points import block, cell_counts

sampling = core.sampling


@pytest.mark.parametrize("index", [0, 1, 12345, 2**31, 2**32 - 1])
def test_one_sample_is_uniform_over_seeds_and_dimensions(index: int) -> None:
    one = np.array([index], dtype=np.uint32)
    for vary in ("seed", "dimension"):
        points = np.concatenate(
            [sampling.sample_2d(*((k, one, 6) if vary == "seed" else (6, one, k))) for k in range(16384)]
        )
        for splits in ((8, 0), (0, 8), (4, 4), (1, 1), (2, 2)):
            p = stats.chisquare(cell_counts(points, splits)).pvalue
            assert p > 1e-5, f"{vary}, cells {splits}: p = {p:.2g}"


def test_dimensions_and_seeds_do_not_know_each_other() -> None:
    index = block(0, 4096)
    columns = [sampling.sample_2d(seed, index, d) for seed in (1, 2, 3) for d in range(12)]
    columns += [sampling.sample_1d(seed, index, d) for seed in (1, 2, 3) for d in range(300, 312)]
    table = np.concatenate(columns, axis=1).astype(np.float64)
    correlation = np.corrcoef(table.T) - np.eye(table.shape[1])
    worst = np.abs(correlation).max()
    print(f"largest correlation of {table.shape[1]} dimensions: {worst:.4f} (independent: {4.3 / 64:.4f})")
    assert worst < 5.5 / 64  # 5.5 standard deviations of independent columns


def test_three_dimensions_are_a_net_and_an_independent_coordinate() -> None:
    points = sampling.sample_3d(9, block(0, 1024), 300)
    assert (cell_counts(points[:, :2], (5, 5)) == 1).all()
    assert (cell_counts(points[:, 2:], (10,)) == 1).all()
    assert stats.chisquare(cell_counts(points, (2, 2, 2))).pvalue > 1e-4


def test_owen_scrambling_converges_faster_than_noise() -> None:
    # A smooth integrand: the error of a scrambled net falls about as n^-1.5 against n^-0.5.
    def rms_error(n: int) -> float:
        estimates = []
        for seed in range(64):
            p = sampling.sample_2d(seed, block(0, n), 11).astype(np.float64)
            estimates.append(np.mean(np.exp(p[:, 0]) * np.sin(np.pi * p[:, 1])))
        return float(np.sqrt(np.mean((np.array(estimates) - (np.e - 1) * 2 / np.pi) ** 2)))

    errors = [rms_error(n) for n in (16, 256, 4096)]
    print("rms error at 16, 256, 4096 points:", *(f"{e:.2e}" for e in errors))
    assert errors[1] < errors[0] / 30 and errors[2] < errors[1] / 30


def test_neighbouring_pixels_share_one_sequence_without_sharing_samples() -> None:
    # 8x8 pixels of 16 samples: together one net of 1024 points, so the mean over the square is far
    # better than 64 independent pixels would be.
    index = []
    seeds = set()
    for y in range(8):
        for x in range(8):
            seed, first = sampling.pixel_sampler(256 + x, 512 + y, 1, 4)
            seeds.add(seed)
            index.append(block(first, 16))
    assert len(seeds) == 1
    points = sampling.sample_2d(seeds.pop(), np.concatenate(index), 4)
    assert (cell_counts(points, (5, 5)) == 1).all()


@pytest.mark.parametrize("log2_samples", [0, 4, 16, 20, 30, 31, 32])
def test_no_two_pixels_share_a_stretch_of_the_sequence(log2_samples: int) -> None:
    starts = [sampling.pixel_sampler(x, y, 7, log2_samples) for y in range(100, 132) for x in range(240, 272)]
    assert len(set(starts)) == len(starts)
    assert all(first + 2**log2_samples <= 2**32 for _, first in starts)


def grid(n: int) -> NDArray[np.float32]:
    g = (np.arange(n, dtype=np.float64) + 0.5) / n
    u, v = np.meshgrid(g, g)
    return np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32)


EXTREMES = np.array(
    [[a, b] for a in (0.0, 0.25, 0.5, 1 - 2**-24) for b in (0.0, 0.25, 0.5, 1 - 2**-24)], dtype=np.float32
)


@pytest.mark.parametrize(
    ("name", "arguments", "moments"),
    [
        # Exact means of x, y(, z) and of x^2, y^2(, z^2).
        ("sample_disk", (), ([0, 0], [1 / 4, 1 / 4])),
        ("sample_triangle", (), ([1 / 3, 1 / 3], [1 / 6, 1 / 6])),
        ("sample_polygon", (4.0, 0.3), ([0, 0], [1 / 6, 1 / 6])),
        ("sample_cosine_hemisphere", (), ([0, 0, 2 / 3], [1 / 4, 1 / 4, 1 / 2])),
        ("sample_uniform_hemisphere", (), ([0, 0, 1 / 2], [1 / 3, 1 / 3, 1 / 3])),
        ("sample_uniform_sphere", (), ([0, 0, 0], [1 / 3, 1 / 3, 1 / 3])),
        ("sample_cone", (0.5,), ([0, 0, 0.75], [5 / 24, 5 / 24, 7 / 12])),
    ],
)
def test_warps_have_the_moments_of_their_shapes(
    name: str, arguments: tuple[float, ...], moments: tuple[list[float], list[float]]
) -> None:
    points = getattr(sampling, name)(*arguments, grid(512)).astype(np.float64)
    np.testing.assert_allclose(points.mean(axis=0), moments[0], atol=1e-4)  # of a 512 x 512 grid
    np.testing.assert_allclose((points**2).mean(axis=0), moments[1], atol=1e-4)  # of a 512 x 512 grid
    edges = getattr(sampling, name)(*arguments, EXTREMES).astype(np.float64)
    assert np.isfinite(edges).all()
    if points.shape[1] == 3:
        np.testing.assert_allclose(np.linalg.norm(edges, axis=1), 1.0, atol=2e-6)
    elif name == "sample_triangle":
        assert (edges >= 0).all() and (edges.sum(axis=1) <= 1.0 + 1e-7).all()
    else:
        assert (np.linalg.norm(edges, axis=1) <= 1 + 2e-6).all()


def test_polygon_is_the_blender_aperture() -> None:
    # Unit hexagon: edges face rotation + k * 60 degrees, corners lie half a step beside them.
    points = sampling.sample_polygon(6.0, 0.2, grid(256)).astype(np.float64)
    angle = (np.arctan2(points[:, 1], points[:, 0]) - 0.2 + np.pi / 6) % (np.pi / 3) - np.pi / 6
    apothem = np.linalg.norm(points, axis=1) * np.cos(angle)
    assert apothem.max() <= np.cos(np.pi / 6) * (1 + 1e-6)
    corners = np.linalg.norm(points, axis=1) > 0.98
    direction = np.arctan2(points[corners, 1], points[corners, 0])
    offset = (direction - 0.2) % (np.pi / 3) - np.pi / 6
    assert corners.any() and np.abs(offset).max() < 0.05


def test_a_tiny_cone_keeps_its_size() -> None:
    directions = sampling.sample_cone(1e-10, grid(64)).astype(np.float64)  # cos would round to 1
    sine = np.linalg.norm(directions[:, :2], axis=1)
    assert sine.max() == pytest.approx(np.sqrt(2e-10), rel=0.05)
    assert sine.mean() == pytest.approx(np.sqrt(2e-10) * 2 / 3, rel=0.01)

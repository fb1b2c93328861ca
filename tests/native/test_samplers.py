"""What each family of points promises, beside Sobol's (test_sampling, hard_cases/test_sampler)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from luch import core, samplers
from numpy.typing import NDArray
from scipy import stats
from support.points import block, counts

sampling = core.sampling
F64 = NDArray[np.float64]
SOBOL, INDEPENDENT, LATTICE = range(3)
OTHERS = [pytest.param(INDEPENDENT, id="independent"), pytest.param(LATTICE, id="lattice")]
EVERY = [pytest.param(SOBOL, id="sobol"), *OTHERS]
# As far as a sequence goes: the first, one in between, the last of 2^31 and beyond (pixels share a sequence).
FIRSTS = [0, 1 << 12, 1 << 31, 2**32 - (1 << 10)]
LATTICE_Y, LATTICE_Z = 3797975533, 753387963
LEAST_DISTANCE = 0.465  # of the lattices of any two coordinates, over the best of as many points


def test_the_names_are_in_the_order_of_the_core() -> None:
    assert samplers.NAMES == ("SOBOL", "INDEPENDENT", "LATTICE")


@pytest.mark.parametrize("family", EVERY)
def test_a_dimension_names_its_family_and_fewer_coordinates_are_the_first_of_more(family: int) -> None:
    for dimension in (0, 1, 70_000, (1 << 30) - 1):
        named = dimension + (family << 30)
        drawn = sampling.sample_any(9, block(5, 64), named)
        assert (drawn[:, 0] >= 0.0).all(), "sample_1d or sample_2d says otherwise"
        np.testing.assert_array_equal(drawn, sampling.sample_3d(9, block(5, 64), named, family))


@pytest.mark.parametrize("family", OTHERS)
@pytest.mark.parametrize("index", [0, 1, 12345, 2**31, 2**32 - 1])
def test_one_sample_is_uniform_over_seeds_and_dimensions(family: int, index: int) -> None:
    one = np.array([index], dtype=np.uint32)
    for vary in ("seed", "dimension"):
        points = np.concatenate(
            [sampling.sample_3d(*((k, one, 6) if vary == "seed" else (6, one, k)), family) for k in range(8192)]
        )
        for sides in ((256, 1, 1), (1, 256, 1), (1, 1, 256), (16, 16, 1), (1, 16, 16), (16, 1, 16), (6, 6, 6)):
            p = stats.chisquare(counts(points, *sides)).pvalue
            assert p > 1e-5, f"{vary}, cells {sides}: p = {p:.2g}"


@pytest.mark.parametrize("family", OTHERS)
def test_dimensions_seeds_and_coordinates_do_not_know_each_other(family: int) -> None:
    index = block(0, 4096)
    columns = [sampling.sample_3d(seed, index, d, family) for seed in (1, 2, 3) for d in range(12)]
    columns += [sampling.sample_1d(seed, index, d, family) for seed in (1, 2, 3) for d in range(300, 312)]
    table = np.concatenate(columns, axis=1).astype(np.float64)
    worst = np.abs(np.corrcoef(table.T) - np.eye(table.shape[1])).max()
    assert worst < 5.5 / 64  # 5.5 standard deviations of independent columns


@pytest.mark.parametrize("family", EVERY)
def test_a_pair_of_dimensions_fills_the_square(family: int) -> None:
    """Correlation sees straight lines alone; here any pattern that one dimension makes over another."""
    index, found = block(0, 1 << 14), []
    for seed in range(8):
        one = sampling.sample_1d(seed, index, 4, family)
        for step in (1, 2, 3, 4, 8, 64):
            pair = np.concatenate([one, sampling.sample_1d(seed, index, 4 + step, family)], axis=1)
            found.append(stats.chisquare(counts(pair, 16, 16)).statistic / 255.0)
    # Where both coordinates are evenly spread, 225 of the 255 degrees of freedom are left; nested orders scatter more.
    assert 225.0 / 255.0 - 0.06 < np.mean(found) < 1.06 and max(found) < 2.0


@pytest.mark.parametrize("family", OTHERS)
def test_samples_are_never_one_nor_negative(family: int) -> None:
    x = sampling.sample_3d(5, block(0, 1 << 22), 3, family)
    assert float(x.min()) >= 0.0 and float(x.max()) < 1.0
    assert float(x.max()) > 1.0 - 2.0**-20


@pytest.mark.parametrize("first", FIRSTS)
def test_independent_samples_fall_into_cells_as_chance_has_it(first: int) -> None:
    """Neither clumps nor a better spread than chance: counts of 64 cells, of blocks by the hundred, as Poisson's."""
    p = []
    for seed in range(12):
        points = sampling.sample_3d(seed, block(first, 1 << 10), 5, INDEPENDENT)
        p += [stats.chisquare(counts(points, *sides)).pvalue for sides in ((64, 1, 1), (8, 8, 1), (4, 4, 4))]
    assert stats.kstest(p, "uniform").pvalue > 1e-4


@pytest.mark.parametrize("first", FIRSTS)
@pytest.mark.parametrize("dimension", [0, 7, 257, 2**32 - 1])
def test_aligned_blocks_of_a_lattice_are_the_lattice_moved(first: int, dimension: int) -> None:
    for seed in (0, 0xDEADBEEF):
        for m in (1, 4, 10):
            points = sampling.sample_3d(seed, block(first, 1 << m), dimension, LATTICE)
            for k in range(3):  # every coordinate by itself is a row of equal steps
                assert (counts(points[:, k : k + 1], 1 << m) == 1).all()
            steps = (points.astype(np.float64) - points[0]) % 1.0 * (1 << m)
            whole = np.rint(steps)
            np.testing.assert_allclose(steps, whole, atol=2.0 ** (m - 23))
            multiple = whole[:, 0].astype(np.int64) % (1 << m)
            for k, factor in ((1, LATTICE_Y), (2, LATTICE_Z)):
                np.testing.assert_array_equal(whole[:, k].astype(np.int64) % (1 << m), multiple * factor % (1 << m))


@pytest.mark.parametrize("factor", [LATTICE_Y, LATTICE_Z, LATTICE_Z * pow(LATTICE_Y, -1, 1 << 32) % (1 << 32)])
def test_points_of_a_lattice_keep_their_distance(factor: int) -> None:
    for m in range(2, 27):
        size = 1 << m
        a, b = (1, factor % size), (0, size)  # a basis, which is reduced as Gauss has it
        while True:
            a, b = sorted((a, b), key=lambda v: v[0] ** 2 + v[1] ** 2)
            times = round((a[0] * b[0] + a[1] * b[1]) / (a[0] ** 2 + a[1] ** 2))
            if times == 0:
                break
            b = (b[0] - times * a[0], b[1] - times * a[1])
        best = size * 2.0 / np.sqrt(3.0)  # squared, of a lattice of triangles
        assert np.sqrt((a[0] ** 2 + a[1] ** 2) / best) >= LEAST_DISTANCE, m


def rms_errors(family: int, of: Callable[[F64, int], F64], truth: float, counted: tuple[int, ...]) -> list[float]:
    """Over 256 seeds, of means over so many points."""
    errors = []
    for n in counted:
        means = [
            float(np.mean(of(sampling.sample_2d(seed, block(0, n), 11, family).astype(np.float64), seed)))
            for seed in range(256)
        ]
        errors.append(float(np.sqrt(np.mean((np.array(means) - truth) ** 2))))
    return errors


def smooth(p: F64, _: int = 0) -> F64:
    return np.exp(p[:, 0]) * np.sin(np.pi * p[:, 1])


def edge(p: F64, turned: int = 0) -> F64:
    """Light and shadow, as most of a picture is: a half-plane through the middle, one of 256 directions."""
    angle = 2.0 * np.pi * (turned + 0.3) / 256.0
    return ((p[:, 0] - 0.5) * np.cos(angle) + (p[:, 1] - 0.5) * np.sin(angle) > 0.0).astype(np.float64)


SMOOTH_MEAN = (np.e - 1.0) * 2.0 / np.pi
SMOOTH_VARIANCE = (np.e**2 - 1.0) / 4.0 - SMOOTH_MEAN**2


@pytest.mark.parametrize(("of", "mean", "variance"), [(smooth, SMOOTH_MEAN, SMOOTH_VARIANCE), (edge, 0.5, 0.25)])
def test_the_error_of_independent_samples_falls_as_one_over_their_number(
    of: Callable[[F64, int], F64], mean: float, variance: float
) -> None:
    counted = (4, 64, 1024)
    for n, error in zip(counted, rms_errors(INDEPENDENT, of, mean, counted), strict=True):
        assert error**2 * n / variance == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 256.0)), n


@pytest.mark.parametrize(("of", "mean", "factor"), [(smooth, SMOOTH_MEAN, 6.0), (edge, 0.5, 6.0)])
def test_a_lattice_converges_faster_than_noise(of: Callable[[F64, int], F64], mean: float, factor: float) -> None:
    """16 times the points: noise falls to a quarter."""
    errors = rms_errors(LATTICE, of, mean, (16, 256, 4096))
    assert errors[1] < errors[0] / factor and errors[2] < errors[1] / factor, errors


@pytest.mark.parametrize("family", EVERY)
def test_neighbouring_pixels_do_not_err_together(family: int) -> None:
    """Where their errors had a sign in common, neither a denoiser nor the eye could average it out."""
    means = np.zeros((200, 8, 8))
    for seed in range(len(means)):
        for y in range(8):
            for x in range(8):
                own, first = sampling.pixel_sampler(256 + x, 512 + y, seed, 4, family)
                means[seed, y, x] = np.mean(
                    edge(sampling.sample_2d(own, block(first, 16), 4, family).astype(np.float64), seed)
                )
    off = means - 0.5
    power = np.mean(off**2)
    for shifted in (off[:, :, 1:] * off[:, :, :-1], off[:, 1:] * off[:, :-1], off[:, 2:] * off[:, :-2]):
        assert np.mean(shifted) / power < 4.0 / np.sqrt(shifted.size)

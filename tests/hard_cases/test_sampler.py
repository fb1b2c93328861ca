"""Sobol's points at their limits. Numbers: the rows of the list of hard cases."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from support.points import block, cell_counts

sampling = core.sampling
DIMENSIONS = [0, 1, 7, 255, 256, 257, 100_000, 2**31, 2**32 - 1]


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("first", [0, 1 << 12, 1 << 31, 2**32 - (1 << 10)])
def test_61_aligned_blocks_put_one_point_in_every_elementary_interval(dimension: int, first: int) -> None:
    for seed in (0, 1, 0xDEADBEEF):
        for m in (1, 4, 10):
            index = block(first, 1 << m)
            assert (cell_counts(sampling.sample_1d(seed, index, dimension), (m,)) == 1).all()
            points = sampling.sample_2d(seed, index, dimension)
            for k in range(m + 1):
                assert (cell_counts(points, (k, m - k)) == 1).all()


def test_61_samples_are_never_one_nor_negative() -> None:
    # Every 24-bit value occurs: the largest must still be below 1.
    seen, part = np.zeros(1 << 24, bool), 1 << 20
    for first in range(0, 1 << 24, part):
        x = sampling.sample_1d(5, block(first, part), 3)[:, 0]
        assert float(x.min()) >= 0.0 and float(x.max()) < 1.0
        seen[(x * np.float32(1 << 24)).astype(np.uint32)] = True  # exact: a power of two
    assert seen.all()

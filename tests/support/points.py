"""Stretches of a sequence, and how many of its points fall in each box of a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def block(start: int, count: int) -> NDArray[np.uint32]:
    return np.arange(start, start + count, dtype=np.uint32)


def counts(points: NDArray[np.float32], *sides: int) -> NDArray[np.int64]:
    """How many points fall in each box of a grid."""
    cells = [np.floor(points[:, k].astype(np.float64) * side).astype(np.int64) for k, side in enumerate(sides)]
    return np.bincount(np.ravel_multi_index(cells, sides), minlength=int(np.prod(sides)))


def cell_counts(points: NDArray[np.float32], splits: tuple[int, ...]) -> NDArray[np.int64]:
    """The same of 2^splits[k] slices along coordinate k."""
    return counts(points, *(1 << split for split in splits))

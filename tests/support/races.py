"""What a race between two ways to render must heed, so that its figures mean something."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from luch.accuracy import DARK
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Turns = tuple[Sequence[float], Sequence[float]]  # relMSE and seconds, a value for each turn
DRAWS = 4000  # of a bootstrap


class Truth:
    """Errors against an engine's own converged picture, whose noise is that of so many samples.

    Another engine's picture would do for no other: a row of pixels further, a map read otherwise, and the difference
    is no error. What both must have in common is their energy.
    """

    def __init__(self, picture: F64, samples: int, noise: float | None = None) -> None:
        """noise: relMSE of the picture itself; None: as that of whatever is held against it, by their samples."""
        self.picture, self.samples, self.noise = picture, samples, noise

    def error(self, picture: F64, samples: float) -> float:
        """Of a picture of so many samples, the reference's own noise taken out. Raises ValueError where that is all."""
        whole = float(np.mean((picture[..., :3] - self.picture) ** 2 / (np.abs(self.picture) + DARK) ** 2))
        left = whole / (1.0 + samples / self.samples) if self.noise is None else whole - self.noise
        if not left > 0.0 and whole > 0.0:
            raise ValueError(f"a reference of {self.samples} samples is no better than what it measures: take more")
        return float(np.sqrt(left))

    def noise_beside(self, error: float, samples: float) -> float:
        """The reference's relMSE over that of a picture with this error, of so many samples."""
        return samples / self.samples if self.noise is None else self.noise / error**2

    def brightness(self, picture: F64) -> float:
        """Over the reference's, less 1."""
        return float(picture[..., :3].mean() / self.picture.mean() - 1.0)


def in_turns(
    one: Callable[[int], object],
    other: Callable[[int], object],
    pairs: int,
    clock: Callable[[], float] = time.process_time,
) -> list[float]:
    """Seconds of one over seconds of the other, pair by pair, now the one first and now the other: what else the
    machine does weighs on both. Take the median."""
    ratios = []
    for pair in range(pairs):
        spent = {}
        for work in (one, other) if pair % 2 else (other, one):
            began = clock()
            work(pair)
            spent[work] = clock() - began
        ratios.append(spent[one] / spent[other])
    return ratios


def products_ratio(theirs: Turns, ours: Turns) -> tuple[float, float, float]:
    """relMSE times seconds, one over the other, with its 95 % interval by drawing turns anew.

    Seconds are compared turn by turn, since what else the machine did weighed on both; errors of one seed have nothing
    in common between engines, so their means are. An interval of few turns is too narrow: draws know no other errors.
    """
    seconds = np.array(theirs[1]) / np.array(ours[1])
    rng, turns = np.random.default_rng(1), len(seconds)

    def drawn(values: Sequence[float] | F64) -> F64:
        return np.asarray(values, np.float64)[rng.integers(0, turns, (DRAWS, turns))]

    errors = drawn(theirs[0]).mean(axis=1) / drawn(ours[0]).mean(axis=1)
    low, high = np.percentile(errors * np.median(drawn(seconds), axis=1), [2.5, 97.5])
    return float(np.mean(theirs[0]) / np.mean(ours[0]) * np.median(seconds)), float(low), float(high)

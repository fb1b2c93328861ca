"""Which parts of a picture get the samples: more where the error is, none of it decided by what it would change.

The relMSE of a picture whose regions have variances v (of one sample, relative) and n samples each is the mean of v / n;
for a given number of samples it is least where n goes as the square root of v (Neyman 1934). The variances are told by
the same deviations that tell the error.

A pixel that decides about itself ends when it looks good, before its bright paths are found, and the picture darkens
(docs/accuracy.md: 1 to 3 % of the light in engines that do). Here each tile is two regions, the white and the black
fields of a chessboard, and each one's samples are decided by what the other's pixels found. Pixels share no samples, so
a pixel's value and its number of samples know nothing of each other, and the mean of its samples stays what it is.
(What is left: the other half's variance is known the better the more samples it had, which this half decided.)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from luch import accuracy
from luch.scene import F32, F64, Film

U32 = NDArray[np.uint32]

TILE = 16  # pixels; TILE_SIZE of the core's renderer
FIRST_DECISION = 32  # samples: fewer say too little of where bright paths will be found
# A region has at least this part of the mean, however little error it shows: what it has not met yet, it may still meet.
LEAST_PART = 0.25
OWN_PART = 0.5  # of a region's variance; the rest is that of its 3 x 3 tiles: bright paths are found here or next to it
# Where the same error takes at least this part of the samples that it takes uniformly, they are taken uniformly.
WORTHWHILE = 0.9
STEPS = (1.0, 1.5)  # times powers of two: counts at which the sequence is well spread
MOST_STEPS = 64


@dataclass(frozen=True)
class Shares:
    """What the regions want of the next samples, in proportion; and what that gains."""

    weights: F64  # (regions,), mean over pixels 1
    samples_part: float  # of a uniform picture's samples, for the same error

    @property
    def worthwhile(self) -> bool:
        return self.samples_part <= WORTHWHILE


class Regions:
    """Halves of tiles: region 2 t + h is the half h of tile t, tiles row by row from the bottom left."""

    def __init__(self, height: int, width: int) -> None:
        self.shape = height, width
        self.rows, self.columns = -(-height // TILE), -(-width // TILE)
        y, x = np.mgrid[:height, :width]
        # TILE is even: a tile's own chessboard is the picture's.
        tile = (y // TILE) * self.columns + x // TILE
        self.of_pixel: NDArray[np.intp] = (2 * tile + (x + y) % 2).astype(np.intp)
        self.pixels: F64 = np.bincount(self.of_pixel.ravel(), minlength=2 * self.rows * self.columns).astype(np.float64)

    @property
    def count(self) -> int:
        return len(self.pixels)

    def variances(self, mean: F32, deviation: F32, share: float, counts: U32) -> F64:
        """Relative variance of one sample of a pixel, (regions,); 0 where nothing is known.

        mean, deviation: of the core's film, (H, W, 3); counts: samples of each region. A region's is told by its own
        pixels alone: what they are divided by, too, is found among them.
        """
        squares = np.zeros(self.shape)
        for half in (0, 1):
            own = self._half(np.arange(self.of_pixel.size).reshape(self.shape), half)
            there = own >= 0
            place = np.where(there, own, 0)
            images = [np.where(there[..., None], image.reshape(-1, 3)[place], np.nan) for image in (mean, deviation)]
            mean_there, deviation_there = (image.astype(np.float32) for image in images)
            (nearest,) = accuracy.relative_squares(mean_there, deviation_there, share, radius=1)
            squares.reshape(-1)[own[there]] = nearest[there]
        squares[~np.isfinite(squares)] = 0.0
        sums = np.bincount(self.of_pixel.ravel(), squares.ravel(), minlength=self.count)
        return np.asarray(counts * sums / np.maximum(self.pixels, 1.0))

    def _half(self, image: NDArray[np.intp], half: int) -> NDArray[np.intp]:
        """Fields of one colour, pushed together row by row: (H, W) -> (H, ceil(W / 2)), -1 where there is none."""
        height, width = self.shape
        out = np.full((height, -(-width // 2)), -1, np.intp)
        for row in (0, 1):
            first = (half + row) % 2
            some = image[row::2, first::2]
            out[row::2, : some.shape[1]] = some
        return out

    def shares(self, variances: F64) -> Shares:
        """By the other half of the same tile, and by those of the tiles around it."""
        other = variances.reshape(self.rows, self.columns, 2)[..., ::-1]
        pixels = self.pixels.reshape(self.rows, self.columns, 2)[..., ::-1]
        around = accuracy.box_sum(other * pixels, 1) / np.maximum(accuracy.box_sum(pixels, 1), 1.0)
        told = np.where(pixels > 0.0, OWN_PART * other + (1.0 - OWN_PART) * around, around).reshape(-1)
        wanted = np.sqrt(told)
        whole = float(np.average(wanted, weights=self.pixels))
        if not whole > 0.0:
            return Shares(np.ones(self.count), 1.0)
        weights = np.maximum(wanted / whole, LEAST_PART)
        weights /= np.average(weights, weights=self.pixels)
        uniform = float(np.average(told, weights=self.pixels))
        return Shares(weights, float(np.average(told / weights, weights=self.pixels)) / uniform)

    def targets(self, weights: F64, counts: U32, samples: int, most: int) -> U32:
        """Samples of each region such that pixels have `samples` on average, at most `most`, and nobody fewer than now.

        The larger `samples`, the larger each region's: going there in several steps ends at the same.
        """

        def at(factor: float) -> F64:
            return np.clip(np.maximum(_stepped(factor * weights), counts), 0, most)

        low, high = 0.0, float(most) / float(weights.min())
        for _ in range(MOST_STEPS):
            middle = 0.5 * (low + high)
            enough = np.average(at(middle), weights=self.pixels) >= samples
            low, high = (low, middle) if enough else (middle, high)
        return at(high).astype(np.uint32)

    def pixel_counts(self, counts: U32) -> U32:
        """Of regions -> of pixels, (H, W)."""
        return np.asarray(counts[self.of_pixel])


def _stepped(samples: F64) -> F64:
    """Down to the next of 1, 1.5, 2, 3, 4, 6, 8, ..."""
    safe = np.maximum(samples, 1.0)
    power = np.exp2(np.floor(np.log2(safe)))
    return np.where(safe >= STEPS[1] * power, STEPS[1] * power, power)


def regions_of(film: Film) -> Regions:
    """Of the rendered part of a picture."""
    width, height = film.size
    return Regions(height, width)


class Adaptive:
    """One render's regions while it grows: uniform up to FIRST_DECISION, then by what the looks find."""

    def __init__(self, film: Film, most: int) -> None:
        """most: samples of any pixel."""
        self.regions = regions_of(film)
        self.counts: U32 = np.zeros(self.regions.count, np.uint32)
        self.shares: Shares | None = None
        self.used = False
        self._most = most

    def decide(self, mean: F32, deviation: F32, share: float, samples: int) -> None:
        """At a look, with what the film told; samples: on average."""
        if samples < FIRST_DECISION:
            return
        self.shares = self.regions.shares(self.regions.variances(mean, deviation, share, self.counts))
        self.used = self.used or self.shares.worthwhile

    def ends(self, samples: int) -> U32:
        """How many samples each region has at the end of the step to so many on average."""
        if not self.used or self.shares is None:
            return np.full(self.regions.count, samples, np.uint32)
        return self.regions.targets(self.shares.weights, self.counts, samples, self._most)

    def statistics(self, counts: U32) -> dict[str, float | int | bool]:
        """For JSON and headers of files. counts: samples of each pixel, as the film has them."""
        told: dict[str, float | int | bool] = {
            "adaptive": self.used,
            "samples_least": int(counts.min()),
            "samples_most": int(counts.max()),
            "samples_mean": float(counts.mean()),
        }
        if self.shares is not None:
            told["adaptive_samples_part"] = self.shares.samples_part
        return told


def line(stats: Mapping[str, Any]) -> str:
    """For people, from a render's statistics; "" where adaptive samples were not asked for."""
    if "adaptive" not in stats:
        return ""
    if stats["adaptive"]:
        return f"{stats['samples_least']} to {stats['samples_most']} samples a pixel, where the error is"
    part = stats.get("adaptive_samples_part")
    why = f": others would take {100.0 * part:.0f} % as many" if part is not None else ""
    return f"the same samples everywhere{why}"


def parts(regions: Regions, begins: U32, ends: U32) -> Iterator[tuple[NDArray[np.intp], int, int]]:
    """Pixels (of the film, in order) that take the same samples: (pixels, first, count); nobody without any."""
    spans = np.stack([begins, ends], axis=1)
    for first, end in np.unique(spans[ends > begins], axis=0):
        same = (begins == first) & (ends == end)
        yield np.flatnonzero(same[regions.of_pixel.ravel()]), int(first), int(end) - int(first)

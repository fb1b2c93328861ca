"""How far a picture is from the truth, told by two parts of its samples.

A render's samples are one Owen-scrambled sequence; its first 2^k and those after them are two parts. With a and b the
errors of two parts of equally many samples, the picture errs by (a + b) / 2, and the deviation d = (a - b) / 2 is what
the film gives. Were a and b independent, d^2 and the picture's squared error would have one expectation, for any
sampler and any distribution; they would differ by ab. A path that only one part found enters both alike, so even an
error made of a few bright pixels is told well, though the next picture's may be another. Parts of one sequence
complement each other, so that d^2 is larger than the squared error by what `overstated` says; luch.curve takes that
out with the rate that it finds. Two sequences scrambled apart would need no correction, but each would be worth less:
measured, relMSE 4 to 10 % higher in a closed room, 1.6 to 3.4 times at 16 samples where edges decide (docs/accuracy.md).

The measure: relMSE = mean((I - R)^2 / (|R| + 0.01)^2) over pixels and channels (Rousselle et al. 2011), R the truth;
its square root is "the error". Samples are drawn by the pixel filter and count for one pixel alone, so neighbours are
not correlated by it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from luch.scene import F32

F64 = NDArray[np.float64]

DARK = 0.01  # added to the truth before division: black has no relative error
NORMAL_95 = 1.96  # standard deviations on either side that hold 95 % of a normal distribution
POOL_RADIUS = 3  # pixels; 7 x 7 neighbours share one variance
NEAR = 1  # pixels; 3 x 3 neighbours tell how unevenly the error is spread
GUIDE_RADIUS = 2  # pixels; how far neighbours may lie that say how bright the truth may be
SURE = 0.25  # of a neighbour's brightness: deviations below tell that it is there
EDGE_GAP = 4.0  # times as bright as its surroundings: a pixel that may lie on a bright neighbour's edge
GAP_VARIANCES = 9.0  # a gap of three standard deviations to a neighbour may still be noise
TILE = 16  # pixels; edge of the tiles whose sums of deviations are taken as independent
# Of the logarithm of a relMSE, one standard deviation: what truths that were guessed are off by in most pictures.
GUESS_SPREAD = 0.06
FIREFLIES = 0.001  # share of the pixels that are asked for their share of the error


@dataclass(frozen=True)
class Estimate:
    """Errors are fractions (0.018: 1.8 %), brightness is in the unit of Combined. _low and _high: 95 % interval."""

    error: float  # square root of the relMSE
    error_low: float
    error_high: float
    fireflies_share: float  # of the relMSE, carried by its largest 0.1 % of pixels
    brightness: float  # mean over pixels and channels
    brightness_low: float
    brightness_high: float

    def scaled(self, factor: float, spread: float) -> Estimate:
        """The errors times a factor whose logarithm is uncertain by so much (one standard deviation)."""
        if not self.error > 0.0:
            return self
        ratio = float(np.exp(np.hypot(np.log(self.error_high / self.error), NORMAL_95 * spread)))
        error = self.error * factor
        return replace(self, error=error, error_low=error / ratio, error_high=error * ratio)

    @property
    def spread(self) -> float:
        """Standard deviation of the error's logarithm, as the interval has it."""
        return float(np.log(self.error_high / self.error)) / NORMAL_95 if self.error > 0.0 else 0.0

    def statistics(self) -> dict[str, float]:
        """For JSON and headers of files."""
        return asdict(self)


def overstated(share: float, rate: float) -> float:
    """By how much the square of a deviation exceeds the squared error, where the first part of one sequence holds that
    share of the samples, a power of two of them, and the relMSE of n samples falls as n^-rate, 1 <= rate < 2.

    Nets are nested: the first 2^k samples and the next 2^k are two halves of a net, whose errors a and b have
    E[ab] = 2 E(2^(k+1)) - E(2^k), with E(n) what n samples err by; so has any sample of the next half with the first,
    as scrambling prefers none. Those of the half after have 2 E(2^(k+2)) - E(2^(k+1)). share 0: of parts that are
    independent, 1.
    """
    if not 0.0 < share < 1.0:
        return 1.0
    rest, power = 1.0 - share, 2.0**-rate
    more = rest / share  # samples of the second part over those of the first
    near, far = 2.0 * power - 1.0, power * (2.0 * power - 1.0)
    both = near if more <= 1.0 else (near + (more - 1.0) * far) / more
    own = more**-rate
    return float(
        share * rest * (1.0 + own - 2.0 * both) / (share * share + rest * rest * own + 2.0 * share * rest * both)
    )


def _sums(image: F64, radius: int, axis: int) -> F64:
    """Of up to 2 radius + 1 neighbours along an axis; fewer at the borders."""
    size = image.shape[axis]
    total = np.concatenate([np.zeros_like(np.take(image, [0], axis)), np.cumsum(image, axis)], axis)
    middle = np.arange(size)
    upper = np.take(total, np.minimum(middle + radius + 1, size), axis)
    return np.asarray(upper - np.take(total, np.maximum(middle - radius, 0), axis))


def box_sum(image: F64, radius: int = POOL_RADIUS) -> F64:
    """Sums over squares of (2 radius + 1)^2 pixels, cut at the borders. Shape (H, W) or (H, W, C), kept."""
    return _sums(_sums(image, radius, 0), radius, 1)


def _measured(deviation: F32) -> tuple[F64, F64, F64]:
    """Deviations with 0 where nothing is known, 1 or 0 for what is known (H, W, 1), and its sums over neighbours."""
    known = np.isfinite(deviation).all(axis=2, keepdims=True)
    return (
        np.where(known, deviation, 0.0).astype(np.float64),
        known.astype(np.float64),
        box_sum(known.astype(np.float64)),
    )


def _borne_out(grey: F32, d: F64, share: float) -> F32:
    """What both parts of a pixel's samples bear out of its brightness: their harmonic mean.

    Parts that agree have all of it. Of a firefly, which one part alone has found, next to nothing: a harmonic mean is
    at most the smaller part over the larger part's share of the samples.
    """
    other = grey + d * (1.0 - 2.0 * share) / np.sqrt(share * (1.0 - share))  # the two, weighted the other way round
    lost = np.divide(d * d, other, out=np.full_like(other, np.inf), where=other > 0.0)
    return np.asarray(np.clip(grey - lost, 0.0, np.maximum(grey, 0.0)), dtype=np.float32)


def _truth_guesses(mean: F32, d: F64, known: F64, share: float) -> list[F32]:
    """What each pixel is divided by: the truth is not known, and a pixel's own noise must not hide its error.

    The mean of those neighbours whose brightness differs by no more than noise explains (Lee's sigma filter, 1983),
    and, as one more of them, of what the pixel's own samples agree upon: an edge keeps its two sides, a highlight
    counts by half, a firefly is held against what lies around it. Noise is what neighbours have in proportion to their
    brightness; by a firefly's own noise any neighbour would do. For the same reason a pixel is compared by the mean of
    its brightness and what is borne out of it. One guess for each radius of GUIDE_RADIUS..1; the nearest neighbours
    were off by half as much as those two pixels away (twelve scenes).
    """
    grey = (known[..., 0] * mean.mean(axis=2)).astype(np.float32)
    deviation = d.mean(axis=2)
    lit = box_sum((grey * grey).astype(np.float64))
    relative = np.divide(box_sum(deviation**2), lit, out=np.zeros_like(lit), where=lit > 0.0)
    noise = (GAP_VARIANCES * relative).astype(np.float32) * grey * grey
    from luch._native import core  # not needed by those who only read numbers

    beside = _beside_bright(grey, np.abs(d).mean(axis=2).astype(np.float32))
    held = _borne_out(grey, deviation, share)
    guesses = core.film.guess_truth(mean, grey, held, noise, known[..., 0] > 0.0, beside, GUIDE_RADIUS, EDGE_GAP)
    return list(guesses)[::-1]


def _beside_bright(grey: F32, deviation: F32) -> NDArray[np.bool_]:
    """Pixels that touch a surely brighter one, (H, W). What makes them bright may be its edge, seen by few samples.

    Against dark neighbours alone, a lamp's edge would count as a firefly whose error is a thousand times the truth.
    """
    sure = np.where(deviation <= SURE * grey, grey, np.float32(0.0))
    brightest = np.zeros_like(grey)
    height, width = grey.shape
    for dy, dx in _ring(1):
        here = slice(max(0, -dy), max(0, height - dy)), slice(max(0, -dx), max(0, width - dx))
        there = slice(max(0, dy), max(0, height + dy)), slice(max(0, dx), max(0, width + dx))
        np.maximum(brightest[here], sure[there], out=brightest[here])
    return np.asarray(brightest >= grey)


def _ring(radius: int) -> list[tuple[int, int]]:
    """Offsets (dy, dx) of the pixels on a square of that radius."""
    steps = range(-radius, radius + 1)
    return [(dy, dx) for dy in steps for dx in steps if max(abs(dy), abs(dx)) == radius]


def relative_deviations(mean: F32, deviation: F32, share: float) -> list[F64]:
    """Deviations over what the truth may be, (H, W, 3); 0 where nothing is known. Mean square: the relMSE.

    share: of the samples that the first part holds. One for each guess at the truth; the last is the best.
    """
    d, known, _ = _measured(deviation)
    mean = np.where(known > 0.0, mean, np.float32(0.0))
    # Squares of floats stay floats: no colour above 1.
    unit = max(float(np.abs(mean).max()), float(np.finfo(np.float32).tiny))

    guesses = _truth_guesses(mean / np.float32(unit), d / unit, known, share)
    return [d / (np.abs(truth).astype(np.float64) * unit + DARK) for truth in guesses]


def _square(deviation: F64) -> F64:
    return np.asarray(np.mean(deviation * deviation, axis=2))


def _tile_sums(image: F64) -> F64:
    """Sums over tiles of TILE^2 pixels, cut at the far borders: (H, W) -> (rows, columns)."""
    rows = np.add.reduceat(image, np.arange(0, image.shape[0], TILE), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, image.shape[1], TILE), axis=1))


def estimate(mean: F32, deviation: F32, share: float = 0.5) -> Estimate | None:
    """The error of a picture from Combined and its deviations, float32 (H, W, 3); None while no pixel has both parts.
    share: of the samples that the first part holds, as the film tells it.

    The interval is for this picture's own error, not for that of pictures with other seeds: with q a pixel's share,
    error and estimate differ by the mean of products ab, whose variance is at most 4 sum(E[q]^2) / P^2 (all of it
    where the channels vary together). The nearest neighbours stand for E[q], as noise may lie in edges one pixel wide; pooled squares of heavy tails are larger than the
    square of the expectation, and widen the interval. So do what guesses at the truth are off by, and
    their disagreement.
    """
    d, known, _ = _measured(deviation)
    pixels = float(known.sum())
    if pixels == 0.0:
        return None
    *rougher, scaled = relative_deviations(mean, deviation, share)
    squares = _square(scaled)
    mse = float(squares.sum()) / pixels
    pooled = np.maximum(box_sum(squares, NEAR), 0.0) / np.maximum(box_sum(known[..., 0], NEAR), 1.0)
    noise = 2.0 * float(np.sqrt(np.sum(pooled * pooled * known[..., 0]))) / pixels
    factor = 1.0
    if mse > 0.0:
        guess = max(abs(np.log(float(_square(other).sum()) / pixels / mse)) for other in rougher)
        factor = float(np.exp(0.5 * np.hypot(NORMAL_95 * np.hypot(noise / mse, GUESS_SPREAD), guess)))
    top = np.sort(squares[known[..., 0] > 0.0])[-max(1, round(FIREFLIES * pixels)) :]
    brightness = float((known * np.where(known > 0.0, mean, 0.0)).sum()) / (3.0 * pixels)
    uncertainty = _uncertainty_of_sum(_tile_sums(d.mean(axis=2))) / pixels
    error = float(np.sqrt(mse))
    return Estimate(
        error=error,
        error_low=error / factor,
        error_high=error * factor,
        fireflies_share=float(top.sum() / squares.sum()) if mse > 0.0 else 0.0,
        brightness=brightness,
        brightness_low=brightness - uncertainty,
        brightness_high=brightness + uncertainty,
    )


def _uncertainty_of_sum(sums: F64) -> float:
    """Half of the 95 % interval of a total of independent sums with mean 0.

    Neighbours take pieces of one sequence, so their errors cancel in part: only sums over tiles are independent. Few
    tiles, or few that matter, tell their own spread badly: Student's distribution for as many as their squares are
    worth, 3 (sum s^2)^2 / sum s^4 of normal ones, to second order in its inverse.
    """
    squares = sums * sums
    total = float(squares.sum())
    if total == 0.0:
        return 0.0
    few = float((squares * squares).sum()) / (3.0 * total * total)
    z = NORMAL_95
    student = z + (z**3 + z) / 4.0 * few + (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0 * few * few
    return student * float(np.sqrt(total))


def percent(fraction: float, digits: int = 2) -> str:
    """0.0183 -> "1.8": so many digits that count, without the sign."""
    if not fraction > 0.0:
        return "0"
    return f"{100.0 * fraction:.{max(0, digits - 1 - int(np.floor(np.log10(100.0 * fraction))))}f}"

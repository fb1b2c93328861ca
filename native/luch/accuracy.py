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


def _rules() -> dict[str, float]:
    """The constants above, for the core."""
    return {
        "dark": DARK,
        "pool_radius": POOL_RADIUS,
        "near": NEAR,
        "guide_radius": GUIDE_RADIUS,
        "sure": SURE,
        "edge_gap": EDGE_GAP,
        "gap_variances": GAP_VARIANCES,
        "tile": TILE,
        "fireflies": FIREFLIES,
    }


def relative_squares(mean: F32, deviation: F32, share: float, radius: int = GUIDE_RADIUS) -> list[F64]:
    """Squared deviations over what the truth may be, means of the channels, (H, W); 0 where nothing is known. Their
    mean is the relMSE.

    share: of the samples that the first part holds. One for each guess at the truth, from neighbours up to 1, 2, ...
    radius pixels away; the first is the best: the nearest neighbours were off by half as much as those two pixels
    away (twelve scenes). The truth is not known, and a pixel's own noise must not hide its error. So it is guessed: the
    mean of those neighbours whose brightness differs by no more than noise explains (Lee's sigma filter, 1983), and, as
    one more of them, of what the pixel's own samples agree upon: an edge keeps its two sides, a highlight counts by
    half, a firefly is held against what lies around it. Noise is what neighbours have in proportion to their
    brightness; by a firefly's own noise any neighbour would do. For the same reason a pixel is compared by the mean of
    its brightness and what is borne out of it: the harmonic mean of its two parts. Parts that agree have all of it; of
    a firefly, which one part alone has found, next to nothing is borne out, as a harmonic mean is at most the smaller
    part over the larger part's share of the samples. A pixel that touches a surely brighter one, and is EDGE_GAP times
    its guess, speaks for itself: what makes it bright may be that one's edge, seen by few samples. Against dark
    neighbours alone, a lamp's edge would count as a firefly whose error is a thousand times the truth.
    """
    from luch._native import core  # not needed by those who only read numbers

    return list(core.film.relative_squares(mean, deviation, share, _rules() | {"guide_radius": radius}))


def estimate(mean: F32, deviation: F32, share: float = 0.5) -> Estimate | None:
    """The error of a picture from Combined and its deviations, float32 (H, W, 3); None while no pixel has both parts.
    share: of the samples that the first part holds, as the film tells it.

    The interval is for this picture's own error, not for that of pictures with other seeds: with q a pixel's share,
    error and estimate differ by the mean of products ab, whose variance is at most 4 sum(E[q]^2) / P^2 (all of it
    where the channels vary together). The nearest neighbours stand for E[q], as noise may lie in edges one pixel wide; pooled squares of heavy tails are larger than the
    square of the expectation, and widen the interval. So do what guesses at the truth are off by, and
    their disagreement.
    """
    from luch._native import core

    sums = core.film.error_sums(mean, deviation, share, _rules())
    pixels = float(sums["pixels"])
    if pixels == 0.0:
        return None
    nearest, *rougher = sums["squares"]  # of relative_squares, added up
    mse = nearest / pixels
    noise = 2.0 * float(np.sqrt(sums["pooled"])) / pixels
    factor = 1.0
    if mse > 0.0:
        guess = max(abs(np.log(other / nearest)) for other in rougher)
        factor = float(np.exp(0.5 * np.hypot(NORMAL_95 * np.hypot(noise / mse, GUESS_SPREAD), guess)))
    brightness = sums["brightness"] / pixels
    uncertainty = _uncertainty_of_sum(sums["tiles"]) / pixels
    error = float(np.sqrt(mse))
    return Estimate(
        error=error,
        error_low=error / factor,
        error_high=error * factor,
        fireflies_share=sums["largest"] / nearest if mse > 0.0 else 0.0,
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

"""Bias and noise of a way to render, told apart by renders with several seeds.

The noise of one render is the variance over seeds. Bias is what endless samples would leave: the mean, over seeds, of
the difference to a render without bias that takes the same random numbers. The square of such a mean is the squared
bias and the mean's own variance, which the seeds tell as well and which is taken out; with two seeds that leaves the
product of both differences. Paths that a choice does not touch are the same in both and add no noise at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from luch import samplers
from luch.accuracy import DARK, F64, NEAR, NORMAL_95, Estimate, box_sum
from luch.curve import HIGHEST_RATE, Curve
from luch.scene import F32

SURE = 2.0  # standard deviations: what is nearer to 0 is not called a bias
RATE_MEMORY = 2  # how many of the last points say where the line lies


class Tally:
    """Mean and variance over seeds, pixel by pixel and channel by channel (Welford 1962)."""

    def __init__(self) -> None:
        self.count = 0
        self._mean: F64 | None = None
        self._squares: F64 | None = None

    def add(self, picture: F32 | F64) -> None:
        """A picture (H, W, 3) of another seed."""
        values = picture.astype(np.float64)
        if self._mean is None or self._squares is None:
            self._mean, self._squares = np.zeros_like(values), np.zeros_like(values)
        self.count += 1
        step = values - self._mean
        self._mean = self._mean + step / self.count
        self._squares = self._squares + step * (values - self._mean)

    @property
    def mean(self) -> F64:
        if self._mean is None:
            raise ValueError("a tally without pictures has no mean")
        return self._mean

    @property
    def variance(self) -> F64:
        """Of one picture; needs two."""
        if self._squares is None or self.count < 2:
            raise ValueError("a tally of fewer than two pictures has no variance")
        return self._squares / (self.count - 1)


def weights(truth: F32 | F64) -> F64:
    """What squared errors are multiplied by: 1 / (|R| + 0.01)^2, (H, W, 3)."""
    return np.asarray(1.0 / (np.abs(truth.astype(np.float64)) + DARK) ** 2)


@dataclass(frozen=True)
class Measured:
    """A relMSE with its standard deviation; it may come out below 0."""

    value: float
    spread: float

    @property
    def error(self) -> float:
        """Its square root; 0 below 0."""
        return float(np.sqrt(max(0.0, self.value)))

    @property
    def low(self) -> float:
        """Of the error, 95 %."""
        return float(np.sqrt(max(0.0, self.value - NORMAL_95 * self.spread)))

    @property
    def high(self) -> float:
        """Of the error, 95 %."""
        return float(np.sqrt(max(0.0, self.value + NORMAL_95 * self.spread)))

    @property
    def sure(self) -> bool:
        """It is not 0."""
        return self.value > SURE * self.spread and self.value > 0.0


def _pooled(image: F64) -> F64:
    """Means over the nearest neighbours."""
    return box_sum(image, NEAR) / box_sum(np.ones_like(image), NEAR)


def noise_of(tally: Tally, weight: F64) -> Measured:
    """relMSE that noise gives one render."""
    noise = np.mean(tally.variance * weight, axis=2)
    spread = np.sqrt(np.sum(2.0 * _pooled(noise) ** 2 / (tally.count - 1)))
    return Measured(float(noise.mean()), float(spread) / noise.size)


def floor_of(differences: Tally, weight: F64) -> Measured:
    """relMSE that bias leaves however many samples are taken. differences: to renders without bias, seed by seed."""
    count = differences.count
    noise = np.mean(differences.variance * weight, axis=2) / count
    squares = np.mean(differences.mean**2 * weight, axis=2) - noise
    around, bias = _pooled(noise), np.maximum(_pooled(squares), 0.0)
    spread = np.sqrt(np.sum(4.0 * bias * around + 2.0 * around**2 * count / (count - 1)))
    return Measured(float(squares.mean()), float(spread) / squares.size)


def brightness_of(differences: Tally, truth: F64) -> tuple[float, float]:
    """Share by which the whole picture is brighter than without bias, and its standard deviation."""
    whole = max(float(truth.mean()), 1e-12)
    spread = np.sqrt(np.sum(_pooled(differences.variance.mean(axis=2)))) / differences.mean[..., 0].size
    return float(differences.mean.mean()) / whole, float(spread) / np.sqrt(differences.count) / whole


@dataclass(frozen=True)
class NoiseLine:
    """relMSE of noise = at_one * samples^-rate. A render without noise: at_one 0."""

    at_one: float
    rate: float
    rate_spread: float = 0.0

    def relmse(self, samples: float) -> float:
        return float(self.at_one * samples**-self.rate)

    def samples_for(self, relmse: float) -> float:
        """Samples at which noise has fallen to it; infinite for 0."""
        if self.at_one == 0.0:
            return 0.0
        return float((self.at_one / relmse) ** (1.0 / self.rate)) if relmse > 0.0 else float("inf")


def fit_noise(points: list[tuple[int, Measured]], sampler: str = samplers.DEFAULT) -> NoiseLine:
    """The line through noise at growing numbers of samples: its rate as luch.curve finds it, its height from the last."""
    seen = [(samples, found) for samples, found in points if found.value > 0.0]
    if not seen:
        return NoiseLine(0.0, 1.0)
    curve = Curve(sampler)
    for samples, found in seen:
        ratio = float(np.exp(NORMAL_95 * 0.5 * found.spread / found.value))
        told = Estimate(found.error, found.error / ratio, found.error * ratio, 0.0, 0.0, 0.0, 0.0)
        curve.add(samples, float(samples), told, share=0.0)  # seeds are independent: nothing is overstated
    rate, spread = curve.rate()
    heights = [np.log(found.value) + rate * np.log(samples) for samples, found in seen[-RATE_MEMORY:]]
    return NoiseLine(float(np.exp(np.mean(heights))), rate, spread)


def fit_errors(points: list[tuple[int, float]]) -> NoiseLine:
    """The line through relMSE of filtered pictures: bias and noise together, whose rate nothing foretells."""
    seen = [(samples, value) for samples, value in points if value > 0.0]
    if not seen:
        return NoiseLine(0.0, 1.0)
    x, y = np.log([float(samples) for samples, _ in seen]), np.log([value for _, value in seen])
    slope = float(np.polyfit(x, y, 1)[0]) if len(seen) > 1 else 0.0
    rate = float(np.clip(-slope, 0.0, HIGHEST_RATE))
    return NoiseLine(float(np.exp(np.mean(y[-RATE_MEMORY:] + rate * x[-RATE_MEMORY:]))), rate)


def relative_error(picture: F32 | F64, truth: F64, weight: F64) -> float:
    """relMSE of a picture."""
    return float(np.mean((picture.astype(np.float64) - truth) ** 2 * weight))

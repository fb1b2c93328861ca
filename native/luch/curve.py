"""The error of one render at growing numbers of samples, and what it foretells.

relMSE falls as n^-p, and p is fitted, not assumed: 1 for independent samples, up to 1.5 and more where well spread
ones fall on edges. The same p corrects the estimates (luch.accuracy.overstated).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from luch import samplers
from luch.accuracy import Estimate, overstated, percent

LOWEST_RATE, HIGHEST_RATE = 0.9, 1.8
POINT_SPREAD = 0.02  # of the logarithm of a relMSE, beside its interval
LEVEL_SPREAD = 0.1  # the same, where points are to tell one level: their luck is not in their intervals
MOST_LUCK = 0.5  # of the logarithm of a relMSE: what lies further off the curve is no luck
MEMORY = 0.5  # weight of a point over that of another with twice as many samples: the rate drifts towards 1
PLAINLY_OFF = 2.0  # standard deviations between a render's own rate and what was known before
RATE_FADES = 0.4  # of what the rate has over 1, on the way to four times the samples and beyond
# Of the rate beyond the points seen: it drifts, and bright paths are found late.
RATE_DRIFT = 0.08
LUCK_STEPS = 24  # until a forecast agrees with itself; each leaves less than a third
TIME_SPREAD = 0.03  # of the logarithm of seconds a sample
NORMAL_80 = 1.2816  # standard deviations on either side that hold 80 % of a normal distribution


@dataclass(frozen=True)
class Forecast:
    """What less error takes, with an 80 % interval; beyond the last point, in seconds. samples: of every pixel."""

    samples: float
    seconds: float
    seconds_low: float
    seconds_high: float


class Curve:
    """Points must come with growing samples and seconds."""

    def __init__(self, sampler: str = samplers.DEFAULT) -> None:
        """sampler: of luch.samplers, whose points the render draws; what is known of its rate before it has begun."""
        self.family = samplers.FAMILIES[sampler]
        self.points: list[tuple[int, float, Estimate, float]] = []  # samples, seconds, as told, share of its first part

    def add(self, samples: int, seconds: float, told: Estimate, share: float = 0.5) -> None:
        """told: from luch.accuracy.estimate; share: as luch.accuracy.overstated has it."""
        self.points.append((samples, seconds, told, share))

    def rate(self) -> tuple[float, float]:
        """p of relMSE ~ samples^-p with its standard deviation: a line through the points, and what is known before."""
        told = [point for point in self.points if point[2].error > 0.0]
        known, doubted = self.family.rate, self.family.spread
        if len(told) < 2 or doubted == 0.0:
            return known, doubted
        x = np.log([point[0] for point in told])
        y = np.log([point[2].error ** 2 / overstated(point[3], known) for point in told])
        own = np.array([2.0 * point[2].spread for point in told])
        w = MEMORY ** ((x[-1] - x) / np.log(2.0)) / (own**2 + POINT_SPREAD**2)
        x, y = x - np.average(x, weights=w), y - np.average(y, weights=w)
        slope, weight = float(np.sum(w * x * y)), float(np.sum(w * x * x))
        # Points that lie off any line more than they claim to are less sure than they claim.
        rest = float(np.sum(w * (y - slope / weight * x) ** 2)) / max(1, len(told) - 2)
        doubt = max(1.0, rest)
        line, certain = -slope / weight, weight / doubt
        # What was known is of other scenes. A line that contradicts it makes the rate less sure; one that contradicts
        # it plainly is followed more closely.
        off = abs(line - known) / float(np.hypot(doubted, certain**-0.5))
        before = (doubted * max(1.0, (off / PLAINLY_OFF) ** 2)) ** -2
        p = (before * known + certain * line) / (before + certain)
        spread = max(1.0, off) * (before + certain) ** -0.5
        return float(np.clip(p, LOWEST_RATE, HIGHEST_RATE)), float(spread)

    def estimates(self) -> list[Estimate]:
        """The points' estimates, with what complementary parts overstate taken out."""
        rate, spread = self.rate()
        return [corrected(told, share, rate, spread) for _, _, told, share in self.points]

    @property
    def last(self) -> Estimate | None:
        """What is known of the picture; None before the first look."""
        if not self.points:
            return None
        _, _, told, share = self.points[-1]
        return corrected(told, share, *self.rate())

    def seconds_a_sample(self) -> float:
        """From the latter half of the samples; the first are dearer."""
        samples, seconds = self.points[-1][:2]
        earlier = [point for point in self.points if 2 * point[0] <= samples]
        if not earlier:
            return seconds / samples
        return max(0.0, seconds - earlier[-1][1]) / (samples - earlier[-1][0])

    def _level(self, rate: float) -> float:
        """Logarithm of the relMSE that a render of the last point's samples has on the mean over its luck, as all
        points tell it; of those long ago the less."""
        told = [
            (samples, one) for (samples, *_), one in zip(self.points, self.estimates(), strict=True) if one.error > 0.0
        ]
        octaves = np.log2([self.points[-1][0] / samples for samples, _ in told])
        now = 2.0 * np.log([one.error for _, one in told]) - rate * np.log(2.0) * octaves
        weights = MEMORY**octaves / np.array([(2.0 * one.spread) ** 2 + LEVEL_SPREAD**2 for _, one in told])
        return float(np.average(now, weights=weights))

    def forecast(self, error: float) -> Forecast:
        """What it takes until the error is that small: 0 if it is; infinite while nothing is known.

        It starts from the error at hand. But the luck of the samples at hand, good or bad, is one part in k of what k
        times as many will have: the forecast goes over to what all points say.
        """
        found = self.last
        if found is None or not error > 0.0:
            return Forecast(np.inf, np.inf, np.inf, np.inf)
        samples = self.points[-1][0]
        if found.error <= error:
            return Forecast(0.0, 0.0, 0.0, 0.0)
        rate, spread = self.rate()
        ahead = 1.0 + (rate - 1.0) * (1.0 - RATE_FADES) if rate > 1.0 else rate
        now, aim = 2.0 * float(np.log(found.error)), 2.0 * float(np.log(error))
        luck = float(np.clip(now - self._level(rate), -MOST_LUCK, MOST_LUCK))
        growth = (now - aim) / ahead  # logarithm of samples needed over samples taken
        for _ in range(LUCK_STEPS):
            growth = (now - luck * (1.0 - float(np.exp(-growth))) - aim) / ahead
        doubt = float(
            np.sqrt(
                (2.0 / rate * found.spread) ** 2
                + (growth / rate) ** 2 * (spread**2 + RATE_DRIFT**2)
                + (found.fireflies_share / rate) ** 2 * (1.0 - np.exp(-growth))
                + TIME_SPREAD**2
            )
        )
        pace = self.seconds_a_sample() * samples
        low, best, high = (pace * max(0.0, float(np.exp(growth + z * NORMAL_80 * doubt)) - 1.0) for z in (-1, 0, 1))
        return Forecast(samples * float(np.expm1(growth)), best, low, high)

    def statistics(self) -> dict[str, Any]:
        """For JSON and headers of files; nothing where nothing is known."""
        found = self.last
        if found is None:
            return {}
        told: dict[str, Any] = dict(found.statistics())
        told["error_curve"] = [
            [point[0], round(point[1], 3), one.error, one.error_low, one.error_high]
            for point, one in zip(self.points, self.estimates(), strict=True)
        ]
        told["error_rate"], told["error_rate_spread"] = self.rate()
        if found.error > 0.0:
            told["next_error"] = next_target(found.error)
            ahead = self.forecast(told["next_error"])
            told["seconds_to_next_error"] = ahead.seconds
            told["seconds_to_next_error_low"] = ahead.seconds_low
            told["seconds_to_next_error_high"] = ahead.seconds_high
        return told


def correction(share: float, rate: float) -> float:
    """What to multiply errors by that parts of one sequence tell."""
    return float(overstated(share, max(1.0, rate)) ** -0.5)


def corrected(told: Estimate, share: float, rate: float, spread: float) -> Estimate:
    """What parts of one sequence overstate taken out (share 0: they are independent). The logarithm of the correction is as uncertain as the rate makes it."""
    rate = max(1.0, rate)
    by = overstated(share, rate)
    step = 0.01
    slope = 0.5 * float(np.log(overstated(share, rate + step) / by)) / step
    return told.scaled(correction(share, rate), slope * spread)


def next_target(error: float) -> float:
    """The next smaller error of 1, 2 or 5 times a power of ten that is worth going for: 0.018 -> 0.01."""
    decade = 10.0 ** np.floor(np.log10(0.8 * error))
    return float(decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= 0.8 * error * (1.0 + 1e-9)))


def describe(stats: Mapping[str, Any]) -> str:
    """For people, from a render's statistics: "error 1.8 % (1.7 to 1.9 %); 1 % would take 41 s (34 to 52 s) more"."""
    low, high = percent(stats["error_low"]), percent(stats["error_high"])
    text = f"error {percent(stats['error'])} % ({low} to {high} %)"
    if "seconds_to_next_error" in stats:
        some, few, many = (stats[f"seconds_to_next_error{end}"] for end in ("", "_low", "_high"))
        text += f"; {stats['next_error'] * 100:g} % would take {some:.2g} s ({few:.2g} to {many:.2g} s) more"
    return text

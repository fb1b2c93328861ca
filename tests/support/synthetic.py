"""Pictures whose truth is known, as sums over growing numbers of samples: what a render's film would hold."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np
from luch import accuracy, samplers
from luch.curve import Curve
from luch.stopping import Stopping
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
SIZE = 40  # pixels
MOST = 512  # samples

# Relative errors of sums of 1..MOST samples: (MOST, SIZE * SIZE), each row a sum over that many samples.
Noise = Callable[[np.random.Generator], F64]


def truth() -> F64:
    """A ramp, waves, and an edge a hundred times as bright on one side: (SIZE, SIZE, 3)."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return np.stack([0.05 + x, 0.3 + 0.2 * np.sin(9 * y), np.where(x > y, 0.02, 2.0)], axis=2)


def normal(rng: np.random.Generator) -> F64:
    return np.cumsum(0.8 * rng.normal(size=(MOST, SIZE * SIZE)), axis=0)


def pareto(rng: np.random.Generator) -> F64:
    """Tails so heavy that the fourth moment is infinite."""
    return np.cumsum(0.7 * (rng.pareto(2.5, (MOST, SIZE * SIZE)) - 1 / 1.5), axis=0)


def fireflies(rng: np.random.Generator) -> F64:
    """Light that one sample in 300 finds, over plain noise."""
    hits = (rng.random((MOST, SIZE * SIZE)) < 1 / 300) * 300.0
    return np.cumsum(0.1 * (hits - 1.0) + 0.4 * rng.normal(size=hits.shape), axis=0)


@functools.cache
def _complementing() -> F64:
    """Cholesky factor of the covariance of sums over samples that complement each other."""
    n = np.arange(1, MOST + 1, dtype=np.float64)
    power = 0.75
    both, gap = n[:, None] ** power + n[None, :] ** power, np.abs(n[:, None] - n[None, :]) ** power
    return np.asarray(np.linalg.cholesky(0.5 * (both - gap) + 1e-9 * np.eye(MOST)))


def stratified(rng: np.random.Generator) -> F64:
    """relMSE falls as n^-1.25."""
    return np.asarray(_complementing() @ rng.normal(size=(MOST, SIZE * SIZE)) * 0.8)


def nothing(rng: np.random.Generator) -> F64:
    return np.zeros((MOST, SIZE * SIZE))


class Picture:
    """One render of the truth, or of black."""

    def __init__(self, noise: Noise, rng: np.random.Generator, black: bool = False) -> None:
        self.truth = truth() * (0.0 if black else 1.0)
        self._sums = noise(rng).reshape(MOST, SIZE, SIZE, 1) + 0.0

    def at(self, samples: int) -> F64:
        return np.asarray(self.truth * (1.0 + self._sums[samples - 1] / samples))

    def film(self, samples: int) -> tuple[F32, F32, float]:
        """As core.render.Renderer.deviations has them."""
        before = max((1 << k for k in range(12)), key=lambda a: a * (samples - a))
        mean, first = self.at(samples), self.at(before)
        rest = (samples * mean - before * first) / (samples - before)
        deviation = (first - rest) * np.sqrt(before * (samples - before)) / samples
        return mean.astype(np.float32), deviation.astype(np.float32), before / samples

    def error(self, samples: int) -> float:
        return float(np.sqrt(np.mean((self.at(samples) - self.truth) ** 2 / (np.abs(self.truth) + accuracy.DARK) ** 2)))

    def look(self, curve: Curve, samples: int) -> None:
        """A point of the curve; a sample takes 10 ms."""
        mean, deviation, share = self.film(samples)
        found = accuracy.estimate(mean, deviation, share)
        assert found is not None
        curve.add(samples, 0.01 * samples, found, share)

    def looked_at(self, counts: Sequence[int], sampler: str = samplers.DEFAULT) -> Curve:
        curve = Curve(sampler)
        for samples in counts:
            self.look(curve, samples)
        return curve

    def rendered_to(self, error: float) -> tuple[int, Stopping, Curve]:
        """How many samples it takes to that error by Luch's own rule."""
        curve, stopping, done = Curve(), Stopping(MOST, error), 0
        while done < MOST:
            done = stopping.next_look(done)
            self.look(curve, done)
            if stopping.look(curve):
                break
        return done, stopping, curve

"""The error of a picture as luch.accuracy describes it, spelled out pixel by pixel: slow, for pictures of a few pixels."""

from __future__ import annotations

import numpy as np
from luch import accuracy
from luch.scene import F32
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def film(rng: np.random.Generator) -> tuple[F32, F32]:
    """Mean and deviation of a picture with dark and bright parts, fireflies, and pixels of which nothing is known."""
    height, width = 21, 35
    mean = rng.gamma(1.0, 1.0, (height, width, 3)) * np.where(np.arange(width) > 20, 8.0, 0.1)[:, None]
    deviation = 0.2 * mean * rng.normal(size=mean.shape)
    mean[3, 4], deviation[3, 4] = 90.0, 85.0
    mean[10:13, 5:7] = deviation[10:13, 5:7] = 0.0
    deviation[rng.random((height, width)) < 0.1] = np.nan
    mean[0, 0], deviation[0, 0] = np.nan, np.nan
    return mean.astype(np.float32), deviation.astype(np.float32)


def around(image: F64, y: int, x: int, radius: int) -> F64:
    """The neighbours of a pixel and itself, cut at the borders: (N,) or (N, C)."""
    cut = image[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
    return cut.reshape(-1, *image.shape[2:])


def known_of(deviation: F32) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(deviation).all(axis=2))


def noise_of(grey: F64, d: F64) -> F64:
    """Variance of a pixel's brightness, from what its neighbours have in proportion to theirs."""
    noise = np.zeros_like(grey)
    for y, x in np.ndindex(grey.shape):
        lit = np.sum(around(grey, y, x, accuracy.POOL_RADIUS) ** 2)
        spread = np.sum(around(d.mean(axis=2), y, x, accuracy.POOL_RADIUS) ** 2)
        noise[y, x] = accuracy.GAP_VARIANCES * spread / lit * grey[y, x] ** 2 if lit > 0.0 else 0.0
    return noise


def harmonic_mean(grey: float, d: float, share: float) -> float:
    """Of the two parts that have this mean and this deviation."""
    half_gap = d / np.sqrt(share * (1.0 - share))
    first, rest = grey + (1.0 - share) * half_gap, grey - share * half_gap
    if not share * rest + (1.0 - share) * first > 0.0:
        return 0.0
    return float(np.clip(first * rest / (share * rest + (1.0 - share) * first), 0.0, max(grey, 0.0)))


def relative_squares(mean: F32, deviation: F32, share: float) -> list[F64]:
    """As luch.accuracy.relative_squares."""
    known = known_of(deviation)
    d = np.where(known[..., None], deviation, 0.0).astype(np.float64)
    light = np.where(known[..., None], mean, 0.0).astype(np.float64)
    grey = light.mean(axis=2)
    noise, size = noise_of(grey, d), np.abs(d).mean(axis=2)
    sure = np.where(size <= accuracy.SURE * grey, grey, 0.0)
    planes = [np.zeros(grey.shape) for _ in range(accuracy.GUIDE_RADIUS)]
    for y, x in np.ndindex(grey.shape):
        held = harmonic_mean(grey[y, x], d[y, x].mean(), share)
        own = light[y, x] * (held / grey[y, x] if grey[y, x] > 0.0 else 0.0)
        near = [(v, u) for v, u in np.ndindex(grey.shape) if max(abs(v - y), abs(u - x)) == 1]
        beside = max((sure[v, u] for v, u in near), default=0.0) >= grey[y, x]
        for radius, plane in enumerate(planes, start=1):
            like = [
                light[v, u]
                for v, u in np.ndindex(grey.shape)
                if 1 <= max(abs(v - y), abs(u - x)) <= radius and known[v, u]
                and ((grey[y, x] + held) / 2.0 - grey[v, u]) ** 2 <= noise[y, x] + noise[v, u]
            ]  # fmt: skip
            guess = np.mean([own, *like], axis=0)
            truth = np.where(beside & (light[y, x] > accuracy.EDGE_GAP * guess), light[y, x], guess)
            plane[y, x] = np.mean((d[y, x] / (np.abs(truth) + accuracy.DARK)) ** 2)
    return planes


def estimate(mean: F32, deviation: F32, share: float) -> dict[str, float]:
    """The statistics of luch.accuracy.estimate."""
    known, nearest_and_others = known_of(deviation), relative_squares(mean, deviation, share)
    pixels, sums = float(known.sum()), [float(squares.sum()) for squares in nearest_and_others]
    nearest, mse = nearest_and_others[0], sums[0] / known.sum()
    pooled = sum(
        (around(nearest, y, x, accuracy.NEAR).sum() / around(known.astype(np.float64), y, x, accuracy.NEAR).sum()) ** 2
        for y, x in np.argwhere(known)
    )
    noise = 2.0 * np.sqrt(pooled) / pixels / mse
    spread = accuracy.NORMAL_95 * np.hypot(noise, accuracy.GUESS_SPREAD)
    factor = np.exp(0.5 * np.hypot(spread, max(abs(np.log(other / sums[0])) for other in sums[1:])))
    largest = np.sort(nearest[known])[-max(1, round(accuracy.FIREFLIES * pixels)) :]
    brightness = float(mean[known].mean(axis=1, dtype=np.float64).sum()) / pixels
    d, tile = np.where(known[..., None], deviation, 0.0).mean(axis=2, dtype=np.float64), accuracy.TILE
    tiles = [d[y : y + tile, x : x + tile].sum() for y in range(0, len(d), tile) for x in range(0, d.shape[1], tile)]
    doubt = accuracy._uncertainty_of_sum(np.array(tiles)) / pixels
    error = float(np.sqrt(mse))
    return {
        "error": error,
        "error_low": error / factor,
        "error_high": error * factor,
        "fireflies_share": float(largest.sum()) / sums[0],
        "brightness": brightness,
        "brightness_low": brightness - doubt,
        "brightness_high": brightness + doubt,
    }

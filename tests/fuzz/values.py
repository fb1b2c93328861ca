"""Numbers, tame and hostile."""

from __future__ import annotations

import numpy as np

Rng = np.random.Generator

HOSTILE = (
    0.0, -0.0, 1.0, -1.0, float("nan"), float("inf"), -float("inf"), 1e30, -1e30, 3.4028234e38, -3.4028234e38, 1e20,
    1e7, -1e7, 1e-7, 1e-20, 1e-38, 1e-45, -1e-45, 0.5, 2.0, 1.0000001, 0.99999994, 1e300, 3.1415927, 6.2831855, 65536.0,
)  # fmt: skip
HOSTILE_COUNTS = (0, 1, 2, 3, 7, 64, 255, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1, 2**32, 2**40, -1)


def hostile(rng: Rng) -> float:
    return HOSTILE[int(rng.integers(len(HOSTILE)))]


def hostile_count(rng: Rng) -> int:
    return HOSTILE_COUNTS[int(rng.integers(len(HOSTILE_COUNTS)))]


def number(rng: Rng, low: float = -2.0, high: float = 2.0, *, wild: float = 0.0) -> float:
    """Even in [low, high], or hostile with the probability `wild`; often one of the two ends."""
    if rng.random() < wild:
        return hostile(rng)
    if rng.random() < 0.2:
        return low if rng.random() < 0.5 else high
    return float(rng.uniform(low, high))


def triple(rng: Rng, low: float = 0.0, high: float = 1.0, *, wild: float = 0.0) -> tuple[float, float, float]:
    return number(rng, low, high, wild=wild), number(rng, low, high, wild=wild), number(rng, low, high, wild=wild)


def chance(rng: Rng, probability: float) -> bool:
    return bool(rng.random() < probability)

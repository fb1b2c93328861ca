"""Closures of a node on the plane z = 0: seen from an angle, drawn from, in a white world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from luch import core
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CAMERA, BACKFACING, DIFFUSE_RAY, EMISSION_ONLY = 1, 512, 4, 256  # path flags
COUNT = 1 << 15
GRAZING = (0.0, 60.0, 85.0, 89.5)  # degrees
ROUGHNESS = (0.0, 1e-6, 1e-3, 0.05, 0.2, 0.5, 0.8, 1.0)


def closures(node: str, inputs: dict[str, Any], degrees: float = 30.0, **context: Any) -> Any:
    """The node's closures on the plane z = 0, seen from the given angle in the xz plane."""
    angle = math.radians(degrees)
    return core.bsdf.Closures(node, inputs, wo=(math.sin(angle), 0.0, math.cos(angle)), **context)


def lattice(count: int = COUNT) -> NDArray[np.float32]:
    """Low-discrepancy points of the unit cube, (count, 3)."""
    i = np.arange(count) + 0.5
    steps = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
    return np.minimum(np.stack([(i * s) % 1.0 for s in steps], axis=1), 0.99999994).astype(np.float32)


def reflectance(c: Any, count: int = COUNT) -> Floats:
    """What the closures send of a white world, (3,)."""
    return np.asarray(c.sample(lattice(count))["throughput"], dtype=float).mean(axis=0)


def hemisphere(count: int, seed: int) -> Floats:
    random = np.random.default_rng(seed)
    z = random.random(count)
    phi, r = 2.0 * np.pi * random.random(count), np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)

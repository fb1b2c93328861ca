"""Phase functions over t = sin^2(angle / 2)."""

from __future__ import annotations

import numpy as np
from luch import core
from numpy.typing import NDArray

F64 = NDArray[np.float64]
SHAPES = [
    ("HENYEY_GREENSTEIN", 0.0, 0.0), ("HENYEY_GREENSTEIN", 0.7, 0.0), ("HENYEY_GREENSTEIN", -0.7, 0.0),
    ("HENYEY_GREENSTEIN", 0.999, 0.0), ("HENYEY_GREENSTEIN", -1.0, 0.0), ("DRAINE", 0.0, 1.0), ("DRAINE", 0.6, 2.0),
    ("DRAINE", -0.5, 20.0), ("DRAINE", 0.99, 250.0), ("FOURNIER_FORAND", 1.33, 0.1), ("FOURNIER_FORAND", 1.1, 0.02),
    ("FOURNIER_FORAND", 1.5, 0.45), ("FOURNIER_FORAND", 2.0, 0.5),
]  # fmt: skip


def towards(t: F64) -> NDArray[np.float32]:
    """Directions with sin^2(angle / 2) = t around +z."""
    sine = 2.0 * np.sqrt(t * (1.0 - t))
    return np.stack([sine, 0.0 * t, 1.0 - 2.0 * t], axis=1).astype(np.float32)


def density(shape: tuple[str, float, float], t: F64) -> F64:
    """Around the peak's own axis: -z where the function scatters back."""
    return np.asarray(core.media.phase_density(*shape, axis(shape) * towards(t)), np.float64)


def axis(shape: tuple[str, float, float]) -> float:
    return -1.0 if shape[0] != "FOURNIER_FORAND" and shape[1] < 0.0 else 1.0


def fine(count: int = 200_001) -> F64:
    """Points over t, close to each other at both ends, where peaks are."""
    peaks = np.geomspace(1e-13, 1e-2, count // 3)
    return np.unique(np.concatenate([[0.0], peaks, np.linspace(0.0, 1.0, count), 1.0 - peaks, [1.0]]))

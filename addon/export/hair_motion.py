"""Hair at another time of the frame: the same curves, elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from luch.scene import F32, Curves

from .context import ExportContext
from .curves import read_points
from .particles import grow, hair_systems


@dataclass
class HairShape:
    """Hair that may change its shape."""

    owner: str
    keys: int
    modifier: str  # of particle hair the name of its modifier; "": hair curves
    points: dict[float, F32] = field(default_factory=dict)  # by time
    noise: float = 0.0  # metres of the object's space: less is no motion


def read_hair(subject: Any, shape: HairShape, context: ExportContext) -> F32 | None:
    """Points (P, 4) of an evaluated object's hair at the current time; None if there is none."""
    if not shape.modifier:
        return read_points(subject.data, context) if len(subject.data.points) else None
    for modifier, system in hair_systems(subject):
        if modifier.name == shape.modifier:
            grown = grow(subject, system)
            if grown is not None:
                shape.noise = max(shape.noise, grown.noise)
                return grown.points
    return None


def tell_hair(curves: Curves, shape: HairShape, times: tuple[float, ...]) -> None:
    """Fill in what changes, if anything does."""
    keys = np.stack([shape.points.get(time, curves.points) for time in times])
    if np.isfinite(keys).all() and np.abs(keys - curves.points).max(initial=0.0) > shape.noise:
        curves.motion_points = keys

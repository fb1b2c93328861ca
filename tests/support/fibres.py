"""Closures of hair: a fibre along x, seen from an angle; directions around it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def view(degrees: float, lean: float) -> dict[str, Any]:
    a, b = math.radians(degrees), math.radians(lean)
    normal = (0.0, 0.0, 1.0)
    wo = (math.sin(a), math.cos(a) * math.sin(b), math.cos(a) * math.cos(b))
    return {"wo": wo, "n": normal, "ng": normal}


def sphere(rows: int = 192, columns: int = 384) -> tuple[Any, Any]:
    """Directions at equal angles from the axis x, which is the fibre's, and around it; the solid angle of each."""
    theta = ((np.arange(rows) + 0.5) / rows - 0.5) * np.pi
    phi = (np.arange(columns) + 0.5) / columns * 2.0 * np.pi
    gt, gp = np.meshgrid(theta, phi, indexing="ij")
    w = np.stack([np.sin(gt), np.cos(gt) * np.cos(gp), np.cos(gt) * np.sin(gp)], -1).reshape(-1, 3)
    return w.astype(np.float32), (np.cos(gt) * np.pi / rows * 2.0 * np.pi / columns).ravel()

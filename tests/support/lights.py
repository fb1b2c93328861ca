"""Helpers for tests of light sampling: matrices, point sets, irradiance by sampling and by closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from luch import core
from numpy.typing import NDArray
from scipy.stats import qmc

F64 = NDArray[np.float64]
NOWHERE = 0xFFFFFFFF  # the native core's "no index"
LAMP, TRIANGLE, WORLD = 1, 2, 3  # EmitterKind
IDENTITY = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]


def mesh_light(positions: Any, triangles: Any = ((0, 1, 2),), **material: Any) -> Any:
    """A mesh that shines, as it stands."""
    mesh = {"positions": np.asarray(positions, np.float32), "triangles": np.asarray(triangles, np.uint32)} | material
    return core.light.TestLights(meshes=[mesh], instances=[{"matrix": IDENTITY, "mesh": 0}])


def look_down(x: float = 0.0, y: float = 0.0, z: float = 1.0) -> list[float]:
    """3x4 matrix, row by row, of a lamp at (x, y, z) that shines along -z."""
    return [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z]


def numbers(count: int, seed: int = 0) -> NDArray[np.float32]:
    """(count, 3) well-spread numbers in [0, 1): u, v and the choice. count: a power of two."""
    points = qmc.Sobol(3, seed=seed).random(count)
    return np.minimum(points, np.nextafter(np.float32(1), np.float32(0))).astype(np.float32)


def rows(vector: Any, count: int) -> NDArray[np.float32]:
    return np.tile(np.asarray(vector, np.float32), (count, 1))


def contributions(lights: Any, p: Any, n: Any, count: int = 1 << 14, seed: int = 0, value: Any = None) -> F64:
    """One estimate of unoccluded irradiance (first channel) per sample. value: radiance of triangles."""
    s = lights.sample(rows(p, count), rows(n, count), False, numbers(count, seed))
    cosine = np.maximum((s["direction"].astype(np.float64) * np.asarray(n, float)).sum(1), 0.0)
    radiance = s["radiance"][:, 0].astype(np.float64) * (1.0 if value is None else value)
    usable = s["kind"] != 0
    return np.where(usable, radiance * cosine / np.where(usable, s["pdf"], 1.0), 0.0)


def irradiance(lights: Any, p: Any, n: Any, count: int = 1 << 14, seed: int = 0, value: Any = None) -> float:
    return float(contributions(lights, p, n, count, seed, value).mean())


def sphere_directions(count: int, seed: int = 1) -> NDArray[np.float32]:
    """(count, 3) well-spread unit directions."""
    u = qmc.Sobol(2, seed=seed).random(count)
    z = 1.0 - 2.0 * u[:, 0]
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(2 * math.pi * u[:, 1]), r * np.sin(2 * math.pi * u[:, 1]), z], 1).astype(np.float32)


def cone_directions(axis: Any, gap: float, count: int) -> NDArray[np.float32]:
    """(count, 3) unit directions, uniform in the cone of cosine >= 1 - gap around a unit axis."""
    u = qmc.Sobol(2, seed=2).random(count)
    z = 1.0 - gap * u[:, 0]
    r = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    w = np.asarray(axis, float)
    t = np.cross(w, [1.0, 0.0, 0.0] if abs(w[0]) < 0.7 else [0.0, 1.0, 0.0])
    t /= np.linalg.norm(t)
    x, y = r * np.cos(2 * math.pi * u[:, 1]), r * np.sin(2 * math.pi * u[:, 1])
    return (x[:, None] * t + y[:, None] * np.cross(w, t) + z[:, None] * w).astype(np.float32)


def polygon_irradiance(corners: Any, p: Any, n: Any) -> float:
    """Irradiance at p, normal n, from a polygon of radiance 1 wholly above the horizon (Lambert's formula)."""
    rays = np.asarray(corners, float) - np.asarray(p, float)
    total = np.zeros(3)
    for a, b in zip(rays, np.roll(rays, -1, axis=0), strict=True):
        normal = np.cross(a, b)
        length = np.linalg.norm(normal)
        if length > 0.0:
            total += normal / length * math.atan2(length, float(a @ b))
    return abs(float(total @ np.asarray(n, float))) / 2.0


TURN = [0.8, 0.36, -0.48, 0.3, 0.0, 0.8, 0.6, -0.2, 0.6, -0.48, 0.64, 1.5]  # a rotation and a place


def store(*lamps: dict[str, Any], **rest: Any) -> Any:
    return core.light.TestLights(lamps=list(lamps), **rest)


LAMPS: dict[str, dict[str, Any]] = {
    "sphere": {"shape": "POINT", "radius": 0.3, "soft_falloff": False},
    "sphere around the point": {"shape": "POINT", "radius": 3.0, "soft_falloff": False},
    "soft disk": {"shape": "POINT", "radius": 0.3},
    "spot": {"shape": "SPOT", "radius": 0.3, "soft_falloff": False, "spot_size": 1.2},
    "narrow large spot": {"shape": "SPOT", "radius": 1.0, "soft_falloff": False, "spot_size": 0.6},
    "soft spot": {"shape": "SPOT", "radius": 0.2, "spot_size": 2.0, "spot_blend": 1.0},
    "square": {"shape": "SQUARE", "size": 0.7},
    "small square": {"shape": "SQUARE", "size": 0.01},
    "large rectangle": {"shape": "RECTANGLE", "size": 30.0, "size_y": 7.0},
    "disk": {"shape": "DISK", "size": 0.4},
    "large ellipse": {"shape": "ELLIPSE", "size": 4.0, "size_y": 2.0},
    "square with spread": {"shape": "SQUARE", "size": 1.0, "spread": 0.8},
    "ellipse with spread": {"shape": "ELLIPSE", "size": 3.0, "size_y": 1.0, "spread": 0.5},
    "sun": {"shape": "SUN", "angle": 0.5},
    "half sky": {"shape": "SUN", "angle": math.pi},
}

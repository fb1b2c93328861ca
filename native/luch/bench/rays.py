"""The rays of the race: rows ``ox oy oz tmin dx dy dz tmax`` of four kinds through a scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from luch.accel import Accel
from luch.bench.meshes import RayScene

F32 = npt.NDArray[np.float32]
KINDS = ("primary", "shadow", "diffuse", "random")
BLOCKS = 16  # a large picture's rays are sampled as this many runs of neighbours


def morton_pixels(size: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """x and y of size * size pixels (a power of two) in Morton order."""
    code = np.arange(size * size, dtype=np.int64)
    x, y = np.zeros_like(code), np.zeros_like(code)
    for bit in range(size.bit_length() - 1):
        x |= (code >> 2 * bit & 1) << bit
        y |= (code >> (2 * bit + 1) & 1) << bit
    return x, y


def as_rays(origin: npt.NDArray[Any], direction: npt.NDArray[Any], t_max: float = math.inf) -> F32:
    """Rows ox oy oz tmin dx dy dz tmax; nothing nearer than 1e-4 of the ray counts, for both contestants."""
    rays = np.zeros((len(direction), 8), np.float32)
    rays[:, 0:3], rays[:, 4:7], rays[:, 7] = origin, direction, t_max
    return rays


def unit(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows of length 1."""
    length: npt.NDArray[Any] = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / length)


def primary_rays(scene: RayScene, size: int, keep: int) -> F32:
    """Camera rays of a 1024 x 1024 picture, `keep` of them as runs of neighbours in Morton order."""
    eye = np.array(scene.eye)
    ahead = unit(np.array(scene.target) - eye)
    right = unit(np.cross(ahead, [0, 0, 1.0]))
    up = np.cross(right, ahead)
    x, y = morton_pixels(size)
    run = keep // BLOCKS
    chosen = (np.arange(BLOCKS)[:, None] * (size * size // BLOCKS) + np.arange(run)).ravel()
    a = ((x[chosen, None] + 0.5) / size * 2 - 1) * scene.fov_tangent
    b = ((y[chosen, None] + 0.5) / size * 2 - 1) * scene.fov_tangent
    return as_rays(eye, unit(ahead + a * right + b * up))


def ray_sets(scene: RayScene, size: int, keep: int, fill: bool = False) -> dict[str, F32]:
    """The four kinds of rays. fill: keep rays of each kind, from a finer picture where many primary rays miss."""
    rng = np.random.default_rng(1)
    accel = Accel(scene.positions, scene.triangles)
    rays = {"primary": primary_rays(scene, size, keep)}
    point, normal = _hit_points(scene, accel, rays["primary"])
    if fill and 0 < len(point) < keep:
        finer = min(size * size * 4, int(1.05 * keep * keep / len(point)))
        point, normal = _hit_points(scene, accel, primary_rays(scene, 2 * size, finer))
    point, normal = point[:keep], normal[:keep]
    rays["shadow"] = as_rays(point, np.array(scene.light) - point, 1.0)
    ball = unit(rng.normal(size=point.shape)) * 0.9999
    rays["diffuse"] = as_rays(point, unit(normal + ball))
    low, high = scene.positions.min(0), scene.positions.max(0)
    a, b = rng.uniform(low, high, (2, keep, 3))
    rays["random"] = as_rays(a, unit(b - a))
    return rays


def _hit_points(scene: RayScene, accel: Accel, rays: F32) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Where rays hit, a little above the surface, and the normals there that face them."""
    t, prim, _, _ = accel.closest(rays)
    hit = prim >= 0
    first = rays[hit].astype(np.float64)
    corners = scene.positions[scene.triangles[prim[hit]]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    normal *= -np.sign((normal * first[:, 4:7]).sum(1, keepdims=True))
    point = first[:, :3] + first[:, 4:7] * t[hit, None]
    point += normal * 1e-4 * t[hit, None]
    return point, normal

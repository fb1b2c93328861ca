"""Meshes and rays that are hard on ray tracers, and the comparison with brute force."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.accel import Accel
from luch.bench.meshes import unit_icosphere
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Mesh = tuple[F32, NDArray[np.uint32]]


def separate(corners: NDArray[Any]) -> Mesh:
    """A mesh of (T, 3, 3) corners, no vertex shared."""
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)


def soup(count: int = 600, size: float = 0.3, seed: int = 1) -> Mesh:
    rng = np.random.default_rng(seed)
    return separate(rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3)))


def slivers(width: float) -> Mesh:
    """Needles: the third corner is `width` off the line through the other two."""
    rng = np.random.default_rng(2)
    a, b = rng.uniform(-1, 1, (2, 500, 3))
    c = a + (b - a) * rng.uniform(0, 1, (500, 1)) + width * rng.normal(size=(500, 3))
    return separate(np.stack([a, b, c], 1))


def icosphere(level: int) -> Mesh:
    """The same in single precision, as a ray tracer takes it."""
    p, t = unit_icosphere(level)
    return p.astype(np.float32), t.astype(np.uint32)


def cube(across: int, high: int) -> Mesh:
    """A closed box of side 2 whose faces are grids: across * across on top and bottom, across * high at the sides."""
    parts: list[Any] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        cells = [across, across, high]
        grid_u, grid_v = np.meshgrid(np.linspace(-1, 1, cells[u] + 1), np.linspace(-1, 1, cells[v] + 1), indexing="ij")
        for side in (-1.0, 1.0):
            points = np.zeros((*grid_u.shape, 3))
            points[..., u], points[..., v], points[..., axis] = grid_u, grid_v, side
            a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
            parts += [np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)]
    points, index = np.unique(np.concatenate(parts).reshape(-1, 3), axis=0, return_inverse=True)
    return points.astype(np.float32), index.reshape(-1, 3).astype(np.uint32)


def rows(origin: NDArray[Any], direction: NDArray[Any], t_min: float = 0.0, t_max: float = np.inf) -> F32:
    """Rays of origins and directions."""
    rays = np.zeros((len(direction), 8), np.float32)
    rays[:, 0:3], rays[:, 3], rays[:, 4:7], rays[:, 7] = origin, t_min, direction, t_max
    return rays


def random_rays(count: int, center: float = 0.0, scale: float = 1.0, seed: int = 7) -> F32:
    rng = np.random.default_rng(seed)
    return rows(center + scale * rng.uniform(-2, 2, (count, 3)), rng.normal(size=(count, 3)))


def aimed_rays(mesh: Mesh, count: int, seed: int = 3) -> F32:
    """From random points to vertices, points of edges and of faces of the mesh, a third each, and along the axes."""
    rng = np.random.default_rng(seed)
    points, triangles = mesh
    corners = points[triangles[rng.integers(len(triangles), size=count)]].astype(np.float64)
    weights = rng.dirichlet(np.ones(3), count)
    weights[::3] = [1, 0, 0]
    weights[1::3, 2] = 0
    target = (corners * (weights / weights.sum(1, keepdims=True))[..., None]).sum(1).astype(np.float32)
    middle = points.mean(0, dtype=np.float64)
    size = np.abs(points - middle).max()
    origin = (middle + size * rng.uniform(-2, 2, (count, 3))).astype(np.float32)
    axis = rng.integers(3, size=count)
    along = rng.random(count) < 0.25  # two coordinates are a vertex's exactly
    line = np.where(np.arange(3) == axis[:, None], origin, target)
    origin = np.where(along[:, None], line, origin)
    return rows(origin, target - origin)


def differences(mesh: Mesh, rays: F32) -> tuple[int, int]:
    """Rays whose hit differs in any bit from brute force's, and rays that hit."""
    tree, oracle = Accel(*mesh, threads=1), Accel(*mesh, kind="BRUTE_FORCE", threads=1)
    ours, truth = tree.closest(rays), oracle.closest(rays)
    differ = np.zeros(len(rays), bool)
    for a, b in zip(ours, truth, strict=True):
        differ |= a.view(np.uint32) != b.view(np.uint32)
    # A few at a time, rays are traced one by one; many scattered ones are interleaved.
    for first in range(0, len(rays), 31):
        few = tree.closest(rays[first : first + 31])
        for a, b in zip(few, truth, strict=True):
            differ[first : first + 31] |= a.view(np.uint32) != b[first : first + 31].view(np.uint32)
    differ |= tree.any(rays) != (truth[1] >= 0)
    differ |= oracle.any(rays) != (truth[1] >= 0)
    return int(differ.sum()), int((truth[1] >= 0).sum())


# Hard on builders and on tests of primitives alike.
HARD_MESHES: dict[str, Mesh] = {
    "soup": soup(),
    "small triangles": soup(1500, 0.02),
    "slivers": slivers(1e-3),
    "needles": slivers(1e-7),
    "collinear": slivers(0.0),
    "coplanar": (soup()[0] * np.float32([1, 1, 0]), soup()[1]),
    "duplicates": tuple(np.tile(a, (5, 1)) for a in soup(120)),  # type: ignore[dict-item]
    "identical": tuple(np.tile(a, (300, 1)) for a in soup(1, 1.0)),  # type: ignore[dict-item]
    "points": separate(np.repeat(np.random.default_rng(1).normal(size=(200, 1, 3)), 3, axis=1)),
    "sphere": icosphere(3),
    "squashed sphere": (icosphere(3)[0] * np.float32([1, 1, 1e-6]), icosphere(3)[1]),
    "grid cube": cube(8, 3),
    "one triangle": soup(1, 1.0),
    "five triangles": soup(5, 1.0),
    "size 2^-i": separate(2.0 ** -np.arange(120)[:, None, None] * np.random.default_rng(2).normal(size=(120, 3, 3))),
}

"""Closed meshes, and rays from within that must not get out: rows 1 to 8 of the list of hard cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from luch.accel import Accel
from numpy.typing import NDArray

from support.accel_meshes import F32, Mesh, cube, icosphere, rows

RAYS_AT_ONCE = 1 << 18


def moved(mesh: Mesh, scale: float = 1.0, distance: float = 0.0, squash: float = 1.0) -> Mesh:
    """Scaled, flattened along z, then taken far away."""
    points = mesh[0].astype(np.float64) * np.array([1, 1, squash]) * scale
    return (points + np.array([1, 0.7, -1.3]) * distance).astype(np.float32), mesh[1]


def bipyramid(sides: int) -> Mesh:
    """Two fans of slivers over one rim."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    points = np.concatenate([rim, [[0, 0, 1], [0, 0, -1]]]).astype(np.float32)
    a, b = np.arange(sides), (np.arange(sides) + 1) % sides
    top, bottom = np.full(sides, sides), np.full(sides, sides + 1)
    return points, np.concatenate([np.stack([a, b, top], 1), np.stack([b, a, bottom], 1)]).astype(np.uint32)


def origins(mesh: Mesh, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Uniform in a ball around the middle, half as large as the mesh, flattened as the mesh is."""
    lo, hi = mesh[0].min(0).astype(np.float64), mesh[0].max(0).astype(np.float64)
    inside = rng.normal(size=(count, 3))
    inside *= (rng.random((count, 1)) ** (1 / 3)) / np.linalg.norm(inside, axis=1, keepdims=True)
    return (lo + hi) / 2 + 0.25 * (hi - lo) * inside


def targets(mesh: Mesh, rng: np.random.Generator, count: int, corners_used: int) -> NDArray[np.float64]:
    """Points of vertices (1), edges (2) or faces (3) of random triangles."""
    corners = mesh[0][mesh[1][rng.integers(len(mesh[1]), size=count)]].astype(np.float64)
    weights = np.zeros((count, 3))
    weights[:, :corners_used] = rng.dirichlet(np.ones(corners_used), count)
    points: NDArray[np.float64] = (corners * weights[..., None]).sum(1)
    return points


def aimed(corners_used: int) -> Callable[[Mesh, np.random.Generator, int], F32]:
    def rays(mesh: Mesh, rng: np.random.Generator, count: int) -> F32:
        origin = origins(mesh, rng, count).astype(np.float32)
        return rows(origin, targets(mesh, rng, count, corners_used).astype(np.float32) - origin)

    return rays


def scattered(mesh: Mesh, rng: np.random.Generator, count: int) -> F32:
    """Uniform directions."""
    return rows(origins(mesh, rng, count), rng.normal(size=(count, 3)))


def along_axes(mesh: Mesh, rng: np.random.Generator, count: int) -> F32:
    """Two coordinates are exactly those of a vertex near that axis; the direction's other components are +0 or -0."""
    middle = (mesh[0].min(0).astype(np.float64) + mesh[0].max(0)) / 2
    reach = (mesh[0].max(0).astype(np.float64) - mesh[0].min(0)) / 8
    near = np.abs(mesh[0] - middle) <= reach
    start = (middle + reach * rng.uniform(-1, 1, (count, 3))).astype(np.float32)
    axis = rng.integers(3, size=count)
    for k in range(3):
        along = np.arange(3) == k
        vertices = mesh[0][(near | along).all(1)]
        chosen = axis == k
        if len(vertices):
            picked = vertices[rng.integers(len(vertices), size=int(chosen.sum()))]
            start[chosen] = np.where(along, start[chosen], picked)
    direction = rng.choice(np.float32([0.0, -0.0]), (count, 3))
    direction[np.arange(count), axis] = rng.choice(np.float32([-1.0, 1.0]), count)
    return rows(start, direction)


RAYS: dict[str, Callable[[Mesh, np.random.Generator, int], F32]] = {
    "vertices": aimed(1),
    "edges": aimed(2),
    "faces": aimed(3),
    "random": scattered,
    "axes": along_axes,
}
BALL = icosphere(5)
MESHES: dict[str, Mesh] = {
    "ball": BALL,
    "grid cube": cube(32, 6),
    "cube": cube(1, 1),
    **{f"ball {distance:.0e} away": moved(BALL, 100.0, distance) for distance in (1e3, 1e5, 1e7)},
    **{f"ball of {size:.0e}": moved(icosphere(4), size) for size in (1e-18, 1e-9, 1e9, 1e18)},
    "squashed ball": moved(BALL, squash=1e-6),
    "bipyramid of 1000": bipyramid(1000),
}


def batches(name: str, kind: str, count: int, seed: int) -> Iterator[F32]:
    """The rays in handy parts; the same for every structure. Rays without a direction are left out."""
    rng = np.random.default_rng([seed, *map(ord, name + kind)])
    while count > 0:
        some = min(count, RAYS_AT_ONCE)
        rays = RAYS[kind](MESHES[name], rng, some)
        yield rays[np.abs(rays[:, 4:7]).max(1) > 0]
        count -= some


def leaks(accel: Accel, name: str, kind: str, count: int, seed: int = 1) -> tuple[int, int]:
    """Rays that got out, and rays traced."""
    out = traced = 0
    for rays in batches(name, kind, count, seed):
        _, prim, _, _ = accel.closest(rays)
        out += int((np.asarray(prim) < 0).sum())
        traced += len(rays)
    return out, traced

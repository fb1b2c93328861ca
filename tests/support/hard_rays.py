"""Rays that are hard on structures, of every sort, and whether a structure's hits are brute force's."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from luch.accel import Accel
from numpy.typing import NDArray

from support.accel_meshes import F32, HARD_MESHES, Mesh, aimed_rays, random_rays, rows, separate, soup
from support.cuda_on_cpu import GPU

RAYS = 800  # of each sort for a tree


def scaled(scale: float) -> Mesh:
    points, triangles = soup()
    return (points * np.float64(scale)).astype(np.float32), triangles


def moved(distance: float) -> Mesh:
    points, triangles = soup()
    return (points * 10 + np.float32([1, 0.7, -1.3]) * distance).astype(np.float32), triangles


OF_TREES: dict[str, Mesh] = {
    **HARD_MESHES,
    "1e-30": scaled(1e-30),
    "1e-18": scaled(1e-18),
    "1e-3": scaled(1e-3),
    "1e18": scaled(1e18),
    "1e36": scaled(1e36),
    "1e3 away": moved(1e3),
    "1e5 away": moved(1e5),
    "1e7 away": moved(1e7),
}
OF_CELLS: dict[str, Mesh] = {
    **HARD_MESHES,
    "cube of large triangles": separate(3 * np.random.default_rng(5).uniform(-1, 1, (60, 3, 3))),
    "sticks": separate(
        np.random.default_rng(6).uniform(-1, 1, (900, 1, 3))
        + np.random.default_rng(7).normal(size=(900, 3, 3)) * np.array([[0], [0.01], [0.8]])
    ),
}


def axis_rays(mesh: Mesh, count: int) -> F32:
    """Along the axes, other components 0 or -0, two coordinates of the origin a vertex's."""
    rng = np.random.default_rng(4)
    points = mesh[0]
    target = points[rng.integers(len(points), size=count)]
    size = np.abs(points - points.mean(0, dtype=np.float64)).max()
    axis = np.arange(3) == rng.integers(3, size=(count, 1))
    sign = rng.choice([-1.0, 1.0], (count, 1))
    direction = np.where(axis, sign * size, rng.choice([0.0, -0.0], (count, 3)))
    return rows(np.where(axis, target - sign * 2 * size * rng.random((count, 1)), target), direction)


def plane_rays(mesh: Mesh, count: int, seed: int = 5) -> F32:
    """Along an axis, the other components +0 or -0, through coordinates of vertices: in the planes of the cells."""
    rng = np.random.default_rng(seed)
    points = mesh[0]
    middle = points.mean(0, dtype=np.float64)
    size = np.abs(points - middle).max()
    origin = points[rng.integers(len(points), size=(count, 3)), np.arange(3)].astype(np.float64)
    axis = np.arange(3) == rng.integers(3, size=(count, 1))
    origin = np.where(axis, middle + size * rng.uniform(-2, 2, (count, 3)), origin)
    direction = np.where(axis, rng.choice([-1.0, 1.0], (count, 3)), rng.choice([0.0, -0.0], (count, 3)))
    return rows(origin.astype(np.float32), direction)


def far_rays(mesh: Mesh, count: int, distance: float = 1e4, seed: int = 6) -> F32:
    """Aimed at the mesh from `distance` times its size away."""
    rays = aimed_rays(mesh, count, seed)
    target = (rays[:, :3] + rays[:, 4:7]).astype(np.float64)
    size = max(np.abs(mesh[0] - mesh[0].mean(0, dtype=np.float64)).max(), 1e-30)
    way = np.random.default_rng(seed).normal(size=(count, 3))
    origin = (target + distance * size * way).astype(np.float32)
    return rows(origin, target - origin)


def short_rays(mesh: Mesh, count: int) -> F32:
    """Aimed rays whose intervals begin and end somewhere along the way."""
    rng = np.random.default_rng(8)
    rays = aimed_rays(mesh, count, 9)
    rays[:, 3], rays[:, 7] = rng.uniform(-0.5, 1, count), rng.uniform(0.5, 2, count)
    return rays


def hard_rays(mesh: Mesh, count: int = 1500) -> F32:
    """Rays of every kind."""
    makers = (aimed_rays, plane_rays, far_rays, short_rays)
    return np.concatenate([random_rays(count), *(make(mesh, count) for make in makers)])


def device_rays(mesh: Mesh, place: str) -> F32:
    """A camera's, scattered and aimed ones, of which some end early; few where fibers trace them."""
    count = 10_000 if place == GPU else 150
    spread = 0.1 * np.stack(np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 8)), -1).reshape(-1, 2)
    camera = rows(np.array([0, 0, -4.0]), np.insert(spread, 2, 1.0, axis=1))  # warps of these go together
    rays = np.concatenate([camera, random_rays(count), aimed_rays(mesh, count)])
    rays[::7, 7] = np.linspace(0.1, 2, len(rays[::7]))  # some end early
    rays[::11, 3] = 0.3
    return rays


@cache
def truth(name: str) -> tuple[F32, tuple[NDArray[Any], ...]]:
    """Rays for a mesh of OF_TREES, and what brute force says: t, prim, u, v, blocked."""
    mesh = OF_TREES[name]
    middle, size = mesh[0].mean(0, dtype=np.float64), np.abs(mesh[0]).max()
    scattered = random_rays(RAYS, scale=size)
    scattered[:, :3] += middle.astype(np.float32) if "away" in name else np.float32(0)
    rays = np.concatenate([scattered, aimed_rays(mesh, RAYS), axis_rays(mesh, RAYS)])
    oracle = Accel(*mesh, kind="BRUTE_FORCE")
    return rays, (*oracle.closest(rays), oracle.blocked(rays))


def bits_differ(ours: tuple[Any, ...], theirs: tuple[Any, ...]) -> int:
    """Rays of which any result differs in any bit."""
    differ = np.zeros(len(ours[0]), bool)
    for a, b in zip(ours, theirs, strict=True):
        differ |= (a != b) if a.dtype == np.uint8 else (a.view(np.uint32) != b.view(np.uint32))
    return int(differ.sum())


def assert_same_bits(ours: Any, truth: Any) -> None:
    for name, a, b in zip(("t", "prim", "u", "v"), ours, truth, strict=True):
        differ = np.flatnonzero(a.view(np.uint32) != b.view(np.uint32))
        assert not len(differ), (
            f"{name} of {len(differ)} rays, first {differ[0]}: {a[differ[0]]} against {b[differ[0]]}"
        )


def assert_same_hits(accel: Accel, mesh: Mesh, rays: F32, spheres: F32 | None = None) -> int:
    """t, primitive, u, v and any-hit are brute force's, bit for bit; returns how many rays hit."""
    truth = Accel(*mesh, kind="BRUTE_FORCE", spheres=spheres).closest(rays)
    assert_same_bits(accel.closest(rays), truth)
    assert np.array_equal(accel.any(rays), truth[1] >= 0)
    return int((truth[1] >= 0).sum())

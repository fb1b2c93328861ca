"""Meshes for the races of bare rays, made from seeds: positions (V, 3) float32, triangles (T, 3) uint32, metres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Part = tuple[Array, Indices]


@dataclass
class RayScene:
    """A mesh, and where to look at it and light it from."""

    name: str
    positions: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.uint32]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    light: tuple[float, float, float]
    fov_tangent: float  # half the picture's width at distance 1


def unit_icosphere(level: int) -> Part:
    """Vertices and triangles of a closed unit sphere of 20 * 4**level triangles."""
    g = (1 + 5**0.5) / 2
    p = np.array([(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g),
                  (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)], float)  # fmt: skip
    t = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                  (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                  (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])  # fmt: skip
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    for _ in range(level):
        edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
        key, index = np.unique(edges[:, 0] * len(p) + edges[:, 1], return_inverse=True)
        middle = p[key // len(p)] + p[key % len(p)]
        a, b, c = len(p) + index.reshape(3, -1)
        t = np.concatenate([np.stack(f, 1) for f in ((t[:, 0], a, c), (t[:, 1], b, a), (t[:, 2], c, b), (a, b, c))])
        p = np.concatenate([p, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
    return p, t


def join(parts: list[Part]) -> Part:
    """One mesh of many."""
    first = np.cumsum([0] + [len(p) for p, _ in parts[:-1]])
    return np.concatenate([p for p, _ in parts]), np.concatenate(
        [t + f for (_, t), f in zip(parts, first, strict=True)]
    )


def sheet(points: Array) -> Part:
    """Triangles over a (rows, columns, 3) grid of points."""
    rows, columns, _ = points.shape
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([i, i + 1, i + columns + 1, i + columns], axis=1)
    return points.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Part:
    """Twelve triangles."""
    corner = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


def lathe(profile: Array, segments: int, flutes: int = 0, depth: float = 0.0) -> Part:
    """Turns a (K, 2) profile of radius and height about z; flutes waves of relative depth along the turn."""
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    wave = 1.0 + depth * np.abs(np.cos(0.5 * flutes * angle))
    radius = profile[:, :1] * wave
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.repeat(profile[:, 1:], segments + 1, 1)], 2)
    return sheet(points)


def moved(part: Part, offset: tuple[float, float, float], scale: float = 1.0, turn: float = 0.0) -> Part:
    """The part scaled, turned about z (radians), moved."""
    points, triangles = part
    c, s = np.cos(turn), np.sin(turn)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * scale + np.array(offset), triangles


def curtain(width: float, height: float, rows: int, columns: int, folds: int) -> Part:
    """A hanging cloth in the xz plane."""
    x = np.linspace(0.0, width, columns)
    z = np.linspace(height, 0.0, rows)
    swing = 0.12 * np.sin(2 * np.pi * folds * x / width) * (0.4 + 0.6 * (height - z)[:, None] / height)
    swing = swing + 0.02 * np.sin(9.0 * x + 4.0 * z[:, None])
    return sheet(np.stack([np.broadcast_to(x, swing.shape), swing, np.broadcast_to(z[:, None], swing.shape)], 2))


def vase(steps: int) -> Array:
    """A profile: radius and height of a vase about a metre high."""
    h = np.linspace(0.0, 1.0, steps)
    return np.stack([0.16 + 0.14 * np.sin(np.pi * h * 1.15) - 0.05 * np.sin(7 * h), h], 1)


def displaced_icosphere(level: int = 8) -> RayScene:
    """20 * 4**level triangles of a lumpy unit sphere."""
    p, t = unit_icosphere(level)
    rng = np.random.default_rng(8)
    height = np.zeros(len(p))
    for octave in range(6):
        for axis in rng.normal(size=(4, 3)):
            height += np.sin(p @ axis * 3.0 * 2**octave + rng.uniform(0, 6)) * 0.05 / 1.9**octave
    p = p * (1.0 + height)[:, None]
    return _scene("icosphere", (p, t), (2.6, 0.4, 0.7), (0, 0, 0), (3, 4, 5), 0.6)


def hall() -> RayScene:
    """A furnished hall of 1.4 million triangles: columns, coffers, chairs, vases, curtains."""
    rng = np.random.default_rng(5)
    parts = [box((-20, -9, -0.2), (20, 9, 0)), box((-20, -9, 9), (20, 9, 9.2)), box((-20, -9.2, 0), (20, -9, 9)),
             box((-20, 9, 0), (20, 9.2, 9)), box((-20.2, -9, 0), (-20, 9, 9)), box((20, -9, 0), (20.2, 9, 9))]  # fmt: skip
    for x in np.arange(-19, 20, 2.0):
        parts.append(box((x - 0.1, -9, 8.4), (x + 0.1, 9, 9)))
    for y in np.arange(-8, 9, 2.0):
        parts.append(box((-20, y - 0.1, 8.5), (20, y + 0.1, 9)))
    h = np.linspace(0.0, 1.0, 90)
    column = lathe(np.stack([0.42 - 0.06 * h + 0.2 * (np.abs(h - 0.5) > 0.46), 8.4 * h], 1), 160, 40, 0.06)
    for x in np.arange(-17.5, 18, 5.0):
        parts += [moved(column, (x, -6.5, 0)), moved(column, (x, 6.5, 0))]
    leg = lathe(np.stack([0.025 + 0.012 * np.sin(25 * h[:40]), 0.45 * h[:40] / h[39]], 1), 24)
    chair = join([moved(leg, (x, y, 0)) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
                 + [moved(leg, (x, 0.22, 0.45), 1.2) for x in np.linspace(-0.2, 0.2, 5)]
                 + [box((-0.25, -0.25, 0.44), (0.25, 0.25, 0.48)), box((-0.25, 0.2, 0.98), (0.25, 0.24, 1.1))])  # fmt: skip
    for _ in range(38):
        x, y, turn = rng.uniform(-18, 18), rng.uniform(-5, 5), rng.uniform(0, 6.3)
        parts.append(moved(chair, (x, y, 0), 1.0, turn))
    pot = lathe(vase(90), 120)
    parts += [moved(pot, (x, side * 8.2, 0), 1.3) for x in np.arange(-16, 17, 8.0) for side in (-1, 1)]
    cloth = curtain(3.0, 7.0, 90, 130, 9)
    parts += [moved(cloth, (x, side * 8.7, 1)) for x in np.arange(-18, 18, 5.0) for side in (-1, 1)]
    return _scene("hall", join(parts), (-18.5, -3.5, 2.2), (4, 1, 2.5), (0.3, 0.2, 8.0), 0.8)


def teapot_in_stadium() -> RayScene:
    """A pot of 200 thousand triangles 0.3 m across in a stadium of 400 m, seen from 0.6 m."""
    rng = np.random.default_rng(2)
    body = lathe(vase(240), 300)
    angle = np.linspace(0, 2 * np.pi, 200)
    tube = np.linspace(0, 2 * np.pi, 120)
    ring = np.stack(np.broadcast_arrays((0.3 + 0.03 * np.cos(tube)) * np.cos(angle)[:, None] + 0.3,
                                        0.03 * np.sin(tube) + 0 * angle[:, None],
                                        (0.3 + 0.03 * np.cos(tube)) * np.sin(angle)[:, None] + 0.5), 2)  # fmt: skip
    pot = moved(join([body, sheet(ring)]), (0, 0, 1.0), 0.28)
    parts = [pot, box((-0.6, -0.6, 0.9), (0.6, 0.6, 1.0)), box((-200, -200, -1), (200, 200, 0))]
    for row in range(24):
        for seat in range(200):
            a = 2 * np.pi * (seat + rng.uniform(-0.1, 0.1)) / 200
            x, y, z = (110 + 3 * row) * np.cos(a), (110 + 3 * row) * np.sin(a), 1.2 * row
            parts.append(box((x - 0.5, y - 0.5, z), (x + 0.5, y + 0.5, z + 0.9)))
    return _scene("teapot", join(parts), (0.35, -0.55, 1.35), (0.02, 0, 1.13), (1.0, -1.5, 3.0), 0.5)


def arcade() -> RayScene:
    """A two-storey court of arches and columns, 260 thousand triangles among walls of a few large ones."""
    parts = [box((-15, -7, -0.3), (15, 7, 0)), box((-15, -7.3, 0), (15, -7, 12)), box((-15, 7, 0), (15, 7.3, 12)),
             box((-15.3, -7, 0), (-15, 7, 12)), box((15, -7, 0), (15.3, 7, 12))]  # fmt: skip
    h = np.linspace(0.0, 1.0, 24)
    column = lathe(np.stack([0.34 - 0.05 * h + 0.12 * (np.abs(h - 0.5) > 0.45), 3.6 * h], 1), 40, 20, 0.05)
    bend = np.linspace(0, np.pi, 24)
    for storey in range(2):
        z = 5.5 * storey
        for side in (-1, 1):
            parts.append(box((-15, min(side * 3.5, side * 7), z + 5.2), (15, max(side * 3.5, side * 7), z + 5.5)))
            for x in np.arange(-13, 14, 2.6):
                parts.append(moved(column, (x, side * 3.5, z)))
                arch = np.stack([np.stack([x + 1.3 + r * np.cos(bend), np.full(24, side * 3.5 + w),
                                           z + 3.6 + r * np.sin(bend)], 1)
                                 for r, w in ((1.0, -0.3), (1.0, 0.3), (1.3, 0.3), (1.3, -0.3), (1.0, -0.3))])  # fmt: skip
                parts.append(sheet(arch))
                parts.append(box((x - 0.3, side * 3.5 - 0.3, z + 3.6), (x + 0.3, side * 3.5 + 0.3, z + 5.2)))
    cloth = curtain(2.2, 4.0, 40, 60, 5)
    parts += [moved(cloth, (x, side * 3.3, 5.6)) for x in np.arange(-12.8, 12, 5.2) for side in (-1, 1)]
    pot = lathe(vase(40), 48)
    parts += [moved(pot, (x, side * 2.9, 0), 0.9) for x in np.arange(-10, 11, 5.0) for side in (-1, 1)]
    return _scene("arcade", join(parts), (-13.0, 0.4, 2.0), (3, -0.6, 3.5), (1.0, 0.5, 11.0), 0.9)


def thatch() -> RayScene:
    """80 thousand triangles a metre long and a millimetre wide, in all directions: their boxes say nothing."""
    rng, count = np.random.default_rng(6), 80_000
    middle = rng.uniform(-1.0, 1.0, (count, 3))
    along = rng.normal(size=(count, 3))
    along *= 0.5 / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(count, 3)))
    across *= 1e-3 / np.linalg.norm(across, axis=1, keepdims=True)
    corners = np.stack([middle - along, middle - along + across, middle + along], 1)
    mesh = corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)
    return _scene("thatch", mesh, (3.5, -2.5, 1.5), (0, 0, 0), (2.0, -3.0, 4.0), 0.5)


def _scene(name: str, mesh: Part, eye: tuple[float, float, float], target: tuple[float, float, float],
           light: tuple[float, float, float], fov_tangent: float) -> RayScene:  # fmt: skip
    positions, triangles = mesh
    return RayScene(name, positions.astype(np.float32), triangles.astype(np.uint32), eye, target, light, fov_tangent)


MESHES: dict[str, Callable[[], RayScene]] = {
    "icosphere": displaced_icosphere, "hall": hall, "teapot": teapot_in_stadium, "arcade": arcade,
}  # fmt: skip
# Beside the race's four: what boxes are bad at.
HARD_MESHES: dict[str, Callable[[], RayScene]] = {"thatch": thatch}

"""Scenes of instances as the bindings take them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from luch import core
from luch.accel import STRUCTURES
from numpy.typing import NDArray

from support.accel_meshes import Mesh, icosphere, soup

ALL = 63  # RayKind bits
NEVER = 2**64 - 1
NO_KINDS = np.zeros(0, np.uint32)

# StructureKind of cpu/accel/structure.h; -1: the eight-wide tree
_NUMBER = {"BVH": -1, **{kind: number for number, kind in enumerate(STRUCTURES)}}


@dataclass
class Scene:
    """Meshes, and instances as (mesh, 3x4 matrix, visibility)."""

    meshes: list[Mesh]
    instances: list[tuple[int, NDArray[Any], int]] = field(default_factory=list)
    spheres: dict[int, NDArray[Any]] = field(default_factory=dict)  # mesh -> (S, 4) centre, radius
    flags: NDArray[Any] = field(default_factory=lambda: np.zeros(0, np.uint8))  # PrimitiveFlag of every triangle

    def build(self, kind: str = "BVH", flatten: int = 0, precision: int = 1) -> Any:
        """The CPU's two levels."""
        return core.ArrayAccel(*self._arrays(), _NUMBER[kind], 1, precision, 1, flatten, self._spheres())

    def trees(
        self, kind: str = "CWBVH", flatten: int = 0, precision: int = 1, threads: int = 1, leave_from: int = NEVER
    ) -> Any:
        """Those for devices."""
        return core.ArraySceneTrees(
            *self._arrays(), _NUMBER[kind], 1, precision, threads, flatten, self._spheres(), leave_from
        )

    def _spheres(self) -> NDArray[Any]:
        of_meshes = [self.spheres.get(m, np.zeros((0, 4))) for m in range(len(self.meshes))]
        return np.concatenate(of_meshes).astype(np.float32)

    def _arrays(self) -> tuple[Any, ...]:
        table, vertex, triangle, ball = [], 0, 0, 0
        for m, (points, triangles) in enumerate(self.meshes):
            balls = len(self.spheres.get(m, ()))
            table.append([vertex, len(points), triangle, len(triangles), ball, balls])
            vertex, triangle, ball = vertex + len(points), triangle + len(triangles), ball + balls
        world = np.array([m for _, m, _ in self.instances], np.float32).reshape(-1, 12)
        inverse = [_inverse(m) for _, m, _ in self.instances]
        return (
            np.concatenate([p for p, _ in self.meshes]), np.concatenate([t for _, t in self.meshes]),
            self.flags, np.array(table, np.uint32), np.array([m for m, _, _ in self.instances], np.uint32),
            world, np.array(inverse, np.float32).reshape(-1, 12),
            np.array([v for _, _, v in self.instances], np.uint32))  # fmt: skip


def _inverse(matrix: NDArray[Any]) -> NDArray[Any]:
    with np.errstate(all="ignore"):
        square = np.vstack([np.float32(matrix), [0, 0, 0, 1]]).astype(np.float64)
        if abs(np.linalg.det(square)) < 1e-300:
            return np.full(12, np.nan)
        return np.linalg.inv(square)[:3].ravel()


def placed(rng: np.random.Generator, spread: float, scale: float = 1.0) -> NDArray[Any]:
    """A random rotation, uneven scale, perhaps mirrored, and place."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.hstack([turn * scale * rng.uniform(0.3, 2, 3), spread * rng.uniform(-1, 1, (3, 1))])


def crowd(count: int, spread: float = 5.0, seed: int = 4) -> Scene:
    """Instances of three meshes, two of them with more triangles than are ever copied."""
    rng = np.random.default_rng(seed)
    scene = Scene([icosphere(4), soup(5000, 0.05), soup(7)])
    scene.instances = [(int(rng.integers(3)), placed(rng, spread), ALL) for _ in range(count)]
    return scene

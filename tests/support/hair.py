"""Scenes of hair for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from luch.scene import Curves, Mesh, Scene
from luch.shader import ProgramBuilder

from support import from_above
from support.effects import closure
from support.from_above import Build, white

FIBRE: dict[str, object] = {
    "absorption": (0.1, 0.3, 0.6), "roughness": 0.3, "radial_roughness": 0.3, "ior": 1.55, "offset": 0.0349,
    "random": 0.5,
}  # fmt: skip


def fibre(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_PRINCIPLED_HAIR", FIBRE, params=(1, 0))


def clear_fibre(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_PRINCIPLED_HAIR", {**FIBRE, "absorption": (0.0, 0.0, 0.0)}, params=(1, 0))


def strands(*curves: Sequence[Sequence[float]]) -> Mesh:
    """A mesh of curves alone; a curve is rows of x, y, z, radius."""
    none = np.zeros((0, 3), np.float32)
    points = np.concatenate([np.array(curve, np.float32).reshape(-1, 4) for curve in curves])
    first = np.cumsum([0, *(len(curve) for curve in curves[:-1])]).astype(np.uint32)
    hair = Curves(points, first, np.zeros(len(curves), np.uint16))
    return Mesh("Fur", none, none.astype(np.uint32), np.zeros(0, np.uint16), curves=hair)


def fur(count: int, seed: int = 3, radius: float = 0.03, points: int = 5) -> Mesh:
    """Curved strands in all directions, some of no radius, some with points that coincide, one that loops."""
    rng = np.random.default_rng(seed)
    root = rng.uniform(-1.5, 1.5, (count, 1, 3))
    step = rng.normal(size=(count, 1, 3)) * 0.25 + rng.normal(size=(count, points, 3)) * 0.12
    rows = np.concatenate([root + np.cumsum(step, 1), rng.uniform(0.0, radius, (count, points, 1))], 2)
    rows[1, :, 3] = 0.0
    rows[2, 2] = rows[2, 1]
    rows[3, :] = rows[3, :1]
    turn = np.linspace(0.0, 4.0 * np.pi, points)
    rows[4, :, 0], rows[4, :, 1], rows[4, :, 2] = np.cos(turn), np.sin(turn), 0.05 * turn
    rows[5, :, :3] *= 1e-3
    return strands(*rows.tolist())


def scene_of(mesh: Mesh, build: Build = white, *, shape: str = "RIBBON", **view: Any) -> Scene:
    """As support.from_above has it, each pixel seen at its centre."""
    scene = from_above.scene_of(mesh, build, **view)
    scene.film.filter, scene.film.filter_width = "BOX", 1e-3
    scene.settings.curve_shape = shape
    return scene

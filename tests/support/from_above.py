"""A mesh of any primitives, seen from above by an orthographic camera: for tests of points and of hair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from luch.scene import Camera, Film, Instances, Light, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder
from numpy.typing import NDArray

from support.accel_meshes import icosphere
from support.effects import closure, program

Build = Callable[[ProgramBuilder], None]
PASSES = ("Combined", "Depth", "Normal", "Position")


def white(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (1.0, 1.0, 1.0)})


def scene_of(
    mesh: Mesh,
    build: Build = white,
    *,
    width: float = 3.0,
    size: int = 24,
    above: float = 10.0,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    matrices: Any = None,
    world: float = 0.0,
    passes: Sequence[str] = PASSES,
) -> Scene:
    """Lit by a sun that shines straight down, or by an even world. width: metres across; size: pixels."""
    eye = np.eye(3, 4)
    eye[:, 3] = at[0], at[1], at[2] + above
    placed = np.eye(3, 4)[None] if matrices is None else matrices
    count = len(placed)
    instances = Instances(
        np.zeros(count, np.uint32), placed, np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip
    sky = ProgramBuilder()
    sky.closure("CLOSURE_EMISSION", sky.vector(world, world, world))
    return Scene(
        meshes=[mesh],
        objects=[Object(mesh.name, 0, [0])],
        instances=instances,
        materials=[Material("Matter", program(build))],
        lights=[] if world else [Light("Sun", "SUN", power=np.pi)],
        world=World("World", sky.finish()) if world else None,
        camera=Camera(kind="ORTHO", ortho_scale=width, clip_start=above * 1e-4, clip_end=above * 1e4, matrix=eye),
        film=Film(width=size, height=size, passes=list(passes)),
        settings=Settings(samples=1, threads=1, accelerator="BVH", max_bounces=8, estimate_error=False),
    )


def balls(*rows: tuple[float, float, float, float]) -> Mesh:
    """A mesh of spheres alone: x, y, z, radius."""
    none = np.zeros((0, 3), np.float32)
    return Mesh("Dust", none, none.astype(np.uint32), np.zeros(0, np.uint16), spheres=np.array(rows, np.float32))


def add_ball(mesh: Mesh) -> None:
    """A lumpy ball of triangles among the mesh's other primitives."""
    positions, triangles = icosphere(2)
    mesh.positions, mesh.triangles = positions * np.float32(0.7), triangles
    mesh.material_slots = np.zeros(len(triangles), np.uint16)


def three_places() -> NDArray[np.float64]:
    """Matrices (3, 3, 4): as it is, stretched, and mirrored."""
    matrices = np.stack([np.eye(3, 4)] * 3)
    matrices[1, :, :3] = [[2.0, 0.3, 0.0], [0.0, 0.5, 0.0], [0.1, 0.0, 1.0]]
    matrices[2, :, :3] = np.diag([-0.4, 1.1, 0.8])
    matrices[:, 0, 3] = 0.0, 2.5, -2.5
    return matrices

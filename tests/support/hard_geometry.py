"""Figures of rows 9 to 16, 28, 36, 37 of the hard cases: leaks, acne, lost energy. Each returns what a test bounds.

They are asked for by tests/hard_cases and, with more rays, by `build.py bench hard-cases`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from luch.scene import F32, F64, Camera, Light, Material, Mesh, Scene

from support.accel_meshes import cube, icosphere, separate
from support.effects import closure, program
from support.hard_scenes import HERE, at, diffuse, looking, mesh_of, picture, scene_of

BLACK = 0.0


def quad(edge: float = 1.0, height: float = 0.0, name: str = "Quad") -> Mesh:
    """A square in a plane of constant z, its diagonal from the lower left to the upper right."""
    h = edge / 2
    corners = np.array([[-h, -h, height], [h, -h, height], [h, h, height], [-h, h, height]], np.float32)
    return Mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.zeros(2, np.uint16))


def room(offset: float, mode: str) -> tuple[Mesh, F64, F64]:
    """A closed box of side 10, 8 by 8 squares a wall, `offset` away; its transform; a camera within, turned a little."""
    points, triangles = cube(8, 8)
    place = (offset, 0.7 * offset, -1.3 * offset)
    inside = np.float32(5.0) * points + (np.float32(place) if mode == "vertices" else np.float32(0.0))
    # Blender keeps places in single precision.
    where = tuple(float(np.float32(x)) for x in place)
    matrix = at(HERE) if mode == "vertices" else at(where)
    eye = tuple(float(np.float32(x + y)) for x, y in zip(where, (1.0, 0.5, -0.5), strict=True))
    turned = looking((0.0, 0.0, 0.0), (1.0, 0.6, 0.3))
    turned[:, 3] = eye
    return mesh_of("Room", (inside.astype(np.float32), triangles)), matrix, turned


def room_scene(offset: float, mode: str, albedo: float, *, size: int, samples: int, **settings: Any) -> Scene:
    """In a white world: whatever is seen has leaked."""
    mesh, matrix, eye = room(offset, mode)
    camera = Camera(kind="EQUIRECTANGULAR", matrix=eye, clip_start=1e-3, clip_end=1e9)
    return scene_of(
        [mesh], [diffuse(albedo)], [matrix], camera=camera, size=(2 * size, size), samples=samples, **settings
    )


def leak(scene: Scene) -> float:
    """Mean of what came in."""
    return float(picture(scene).mean(dtype=np.float64))


def ball_inside(radius: float, *, size: int, samples: int, albedo: float = BLACK, **settings: Any) -> Scene:
    """An icosphere seen from within, clipped at a thousandth of its radius."""
    points, triangles = icosphere(3)
    mesh = mesh_of("Ball", ((points * np.float32(radius)).astype(np.float32), triangles))
    eye = looking((0.1 * radius, 0.05 * radius, 0.0), (radius, 0.0, 0.0))
    camera = Camera(kind="EQUIRECTANGULAR", matrix=eye, clip_start=max(radius * 1e-3, 1e-6), clip_end=10 * radius)
    return scene_of([mesh], [diffuse(albedo)], camera=camera, size=(2 * size, size), samples=samples, **settings)


def camera_above(across: float) -> Camera:
    """Straight down on the origin, `across` metres wide."""
    return Camera(kind="ORTHO", matrix=looking((0.1, 0.2, 9.0), (0.1, 0.2, 0.0)), ortho_scale=across)


def sun(elevation_degrees: float, strength: float = 3.0) -> Light:
    a = math.radians(elevation_degrees)
    matrix = looking((math.cos(a), 0.0, math.sin(a)), (0.0, 0.0, 0.0))
    matrix[:, 3] = 0.0
    return Light("Sun", "SUN", matrix=matrix, power=strength)


def far_plane(distance: float, offset: float, tilt_degrees: float, elevation_degrees: float, **settings: Any) -> float:
    """Share of pixels that are off by more than 2 % from albedo * irradiance * cosine / pi."""
    steps = np.linspace(-1, 1, 65)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    reach = 4.0 * distance
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3) * reach
    k = np.arange(64 * 65).reshape(64, 65)[:, :-1].ravel()
    triangles = np.concatenate([np.stack([k, k + 65, k + 66], 1), np.stack([k, k + 66, k + 1], 1)]).astype(np.uint32)
    tilt = math.radians(tilt_degrees)
    turn = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    place = (offset, -offset, 0.5 * offset)
    matrix = np.column_stack([turn, place])
    normal = turn[:, 2]
    eye = looking(HERE, -normal)
    eye[:, 3] = np.add(place, normal * distance)
    camera = Camera(kind="PERSP", matrix=eye, clip_start=1e-3 * distance, clip_end=1e9)
    lamp = sun(elevation_degrees)
    # Its elevation is over the plane.
    lamp.matrix[:, :3] = turn @ lamp.matrix[:, :3]
    scene = scene_of([mesh_of("Plane", (points.astype(np.float32), triangles))], [diffuse(0.8)], [matrix], camera=camera,
                     world=0.0, lights=[lamp], size=(32, 32), **settings)  # fmt: skip
    truth = 0.8 * lamp.power * math.sin(math.radians(elevation_degrees)) / math.pi
    return float((np.abs(picture(scene) / truth - 1.0).max(axis=2) > 0.02).mean())


def edge_energy(
    edge: float, material: Material, *, size: int = 32, samples: int = 64, **settings: Any
) -> tuple[float, float]:
    """|E - 1| of a quad in a furnace, looked at along its diagonal; and the worst pixel's."""
    across = 0.02 * edge
    matrix = looking((0.0, 0.0, 2.0 * edge), (0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    camera = Camera(kind="ORTHO", matrix=matrix, ortho_scale=across, clip_start=1e-3, clip_end=1e9)
    # A strip of one pixel beside the diagonal, where its edge lies, is what is at stake.
    pixels = picture(scene_of([quad(edge)], [material], camera=camera, size=(4, size), samples=samples, **settings))
    off = np.abs(pixels.astype(np.float64) - 1.0)
    return abs(float(pixels.mean(dtype=np.float64)) - 1.0), float(off.max())


def stack_of_objects(copies: int, **settings: Any) -> Scene:
    """A lit quad, as one of `copies` that coincide."""
    meshes = [quad(4.0, name=f"Quad {k}") for k in range(copies)]
    camera = Camera(kind="ORTHO", matrix=looking((0.3, 0.2, 5.0), (0.3, 0.2, 0.0)), ortho_scale=2.0)
    return scene_of(meshes, [diffuse(0.5)], camera=camera, world=0.3, lights=[sun(60.0)], **settings)


def stack(copies: int, **settings: Any) -> F32:
    """Their picture."""
    return picture(stack_of_objects(copies, **settings))


def stack_in_one_mesh(copies: int, **settings: Any) -> Scene:
    """The same quads as triangles of one mesh."""
    one = quad(4.0)
    corners = np.tile(one.positions[one.triangles], (copies, 1, 1))
    camera = Camera(kind="ORTHO", matrix=looking((0.3, 0.2, 5.0), (0.3, 0.2, 0.0)), ortho_scale=2.0)
    return scene_of([mesh_of("Quads", separate(corners))], [diffuse(0.5)], camera=camera, world=0.3, lights=[sun(60.0)],
                    **settings)  # fmt: skip


def thin_gap(base: float, gap: float, mode: str = "object", covered: bool = True, **settings: Any) -> float:
    """The brightest pixel of a floor at height `base` under a black cover `gap` above it, in a sun from above.

    The floor is seen from below through nothing: a camera between would not fit, so that the floor lets its light
    through (translucent) and is looked at from below.
    """
    floor = quad(4.0, 0.0 if mode == "object" else base, "Floor")
    cover = quad(6.0, 0.0 if mode == "object" else float(np.float32(base) + np.float32(gap)), "Cover")
    places = [at((0.0, 0.0, base)), at((0.0, 0.0, base + gap))] if mode == "object" else [at(HERE), at(HERE)]
    camera = Camera(kind="ORTHO", matrix=looking((0.1, 0.05, base - 5.0), (0.1, 0.05, base)), ortho_scale=1.0,
                    clip_end=1e5)  # fmt: skip
    veil = Material("Veil", program(lambda b: closure(b, "CLOSURE_TRANSLUCENT", {"color": (1.0, 1.0, 1.0)})))
    count = 2 if covered else 1
    scene = scene_of([floor, cover][:count], [veil, diffuse(0.0)], places[:count], camera=camera, world=0.0,
                     lights=[sun(80.0)], **settings)  # fmt: skip
    return float(picture(scene).max())


def convex(matrices: Sequence[F64], **settings: Any) -> F32:
    """An icosphere of albedo 1 in a furnace, as it is or as instances."""
    ball = mesh_of("Ball", icosphere(3))
    camera = Camera(kind="ORTHO", matrix=looking((0.1, 0.2, 9.0), (0.1, 0.2, 0.0)), ortho_scale=2.4)
    return picture(scene_of([ball] * len(matrices), [diffuse(1.0)], matrices, camera=camera, bounces=32, **settings))

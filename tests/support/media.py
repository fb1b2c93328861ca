"""Boxes of media before a bright or black world, for tests of volumes."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import Camera, Film, Instances, Light, Material, Medium, Mesh, Object, Phase, Scene, Settings, World
from luch.shader import ProgramBuilder

from support.effects import ONE, closure, program

Triple = tuple[float, float, float]


def even(color: Triple, g: float = 0.0) -> Phase:
    """Henyey-Greenstein."""
    return Phase("HENYEY_GREENSTEIN", color, g)


def clear(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_TRANSPARENT", {}, weight=ONE)


def fog(medium: Medium, name: str = "Fog") -> Material:
    """A volume without a surface."""
    return Material(name, program(clear), volume=medium, only_volume=True)


def box(name: str, half: Triple, centre: Triple = (0.0, 0.0, 0.0)) -> Mesh:
    """A closed box whose faces face outwards."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.uint32)
    points = (corners * np.array(half) + np.array(centre)).astype(np.float32)
    return Mesh(name, points, triangles, np.zeros(12, np.uint16))


def shining(color: Triple) -> World:
    def build(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_EMISSION", {}, weight=color)

    return World("World", program(build))


def at(x: float, y: float, z: float) -> Any:
    return np.array([[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z]])


def placed(meshes: list[Mesh], materials: list[Material], **fields: Any) -> Scene:
    """Mesh k shows material k, as it stands. An orthographic camera looks down from z = 10 on a spot of the origin."""
    count = len(meshes)
    instances = Instances(
        np.arange(count, dtype=np.uint32), np.repeat(np.eye(3, 4)[None], count, axis=0), np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip
    scene = Scene(
        meshes=meshes,
        objects=[Object(mesh.name, k, [k]) for k, mesh in enumerate(meshes)],
        instances=instances,
        materials=materials,
        camera=Camera(kind="ORTHO", matrix=at(0.03, 0.02, 10.0), ortho_scale=0.01),
        film=Film(width=8, height=8),
        settings=Settings(samples=16, threads=1, accelerator="BVH"),
    )
    for name, value in fields.items():
        setattr(scene, name, value)
    return scene


def slab(medium: Medium, thickness: float = 1.0, **fields: Any) -> Scene:
    """A wide slab, its top at z = 0."""
    half = (5.0, 5.0, 0.5 * thickness)
    return placed([box("Slab", half, (0.0, 0.0, -0.5 * thickness))], [fog(medium)], **fields)


def bulb(place: Triple, power: float = 100.0, **fields: Any) -> Light:
    return Light("Bulb", "POINT", matrix=at(*place), power=power, **fields)

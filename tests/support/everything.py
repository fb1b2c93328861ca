"""A small scene with a bit of everything: what every device and every way to render it must agree on."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import Camera, Film, Instances, Light, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder

from support.effects import closure, principled, program


def quad(name: str, half: float, z: float) -> Mesh:
    """A square that faces up."""
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], np.float32)
    return Mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.zeros(2, np.uint16))


def stone(builder: ProgramBuilder) -> None:
    principled(builder, base_color=(0.6, 0.5, 0.4), roughness=0.4, coat_weight=0.3)


def glass(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_GLASS", {"color": (0.9, 1.0, 0.9), "roughness": 0.1, "ior": 1.4})


def leaf(builder: ProgramBuilder) -> None:
    """Half there."""
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.2, 0.6, 0.1)}, weight=(0.5, 0.5, 0.5))
    closure(builder, "CLOSURE_TRANSPARENT", {"color": (1.0, 1.0, 1.0)}, weight=(0.5, 0.5, 0.5))


def glow(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_EMISSION", {"color": (1.0, 0.7, 0.4), "strength": 6.0})


def sky(builder: ProgramBuilder) -> None:
    """Brighter where the direction's z is higher: a program that must run for each ray."""
    up = builder.op3("POINT_POSITION", (), (0, 0))[2]
    closure(builder, "CLOSURE_EMISSION", {"color": (0.3, 0.5, 0.9), "strength": up})


def everything(**settings: Any) -> Scene:
    """Floor, glass pane, two half transparent leaves (instances, one turned), a glowing square, lamps of each kind."""
    turned = np.array([[0.8, -0.6, 0, 1.0], [0.6, 0.8, 0.0, -0.5], [0.0, 0.1, 1.2, 0.4]])
    places = [np.eye(3, 4) for _ in range(4)] + [turned]
    count = len(places)
    instances = Instances(
        np.array([0, 1, 2, 3, 2], np.uint32), np.stack(places), np.linspace(0, 1, count, dtype=np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip

    def at(x: float, y: float, z: float) -> Any:
        return np.array([[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z]])

    return Scene(
        meshes=[quad("Floor", 4.0, 0.0), quad("Pane", 0.8, 1.5), quad("Leaf", 0.7, 2.0), quad("Panel", 0.5, 3.0)],
        objects=[Object("Floor", 0, [0]), Object("Pane", 1, [1]), Object("Leaf", 2, [2]), Object("Panel", 3, [3])],
        instances=instances,
        materials=[Material("Stone", program(stone)), Material("Glass", program(glass)),
                   Material("Leaf", program(leaf)), Material("Glow", program(glow))],
        lights=[Light("Bulb", "POINT", matrix=at(1.0, 0.5, 4.0), power=300.0, radius=0.3),
                Light("Window", "AREA", matrix=at(-1.5, 0.0, 3.5), power=60.0, size=1.0),
                Light("Sun", "SUN", matrix=at(0, 0, 5.0), power=1.5, angle=0.2)],
        world=World("Sky", program(sky), map_resolution=32),
        camera=Camera(matrix=at(0.2, 0.1, 6.0), lens_mm=36.0, fstop=2.0, focus_distance=5.0, use_dof=True),
        film=Film(width=20, height=14),
        settings=Settings(samples=4, accelerator="BVH", threads=1, **settings),
    )  # fmt: skip

"""A floor under a sheet of glass: light that only photons find, with a known answer.

The sheet is one interface: above it is air, below it all is glass. Light comes straight down from a sun without size, so
no path that leaves the floor meets it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from luch.scene import Camera, Film, Light, Material, Mesh, Object, Scene, Settings
from luch.shader import ProgramBuilder

from support.effects import closure, program
from support.everything import quad
from support.hard_scenes import instances_of

IOR, ALBEDO, SUN = 1.5, 0.5, math.pi  # W/m2
HALF = 2.0  # metres, of floor and sheet


def glass(builder: ProgramBuilder, roughness: float = 0.0) -> None:
    closure(builder, "CLOSURE_GLASS", {"color": (1.0, 1.0, 1.0), "roughness": roughness, "ior": IOR})


def grey(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (ALBEDO,) * 3})


def objects_of(meshes: Sequence[Mesh]) -> list[Object]:
    """Each mesh with the material of its own number."""
    return [Object(mesh.name, number, [number]) for number, mesh in enumerate(meshes)]


def scene_through_glass(samples: int = 64, size: int = 8, **settings: Any) -> Scene:
    """Seen from above by an orthographic camera, a square of 1 m in the middle of 4 m."""
    meshes = [quad("Floor", HALF, 0.0), quad("Sheet", HALF, 0.02)]
    eye = np.eye(3, 4)
    eye[2, 3] = 5.0
    return Scene(
        meshes=meshes,
        objects=objects_of(meshes),
        instances=instances_of(range(len(meshes)), [np.eye(3, 4)] * len(meshes)),
        materials=[Material("Grey", program(grey)), Material("Glass", program(glass))],
        lights=[Light("Sun", "SUN", power=SUN)],
        camera=Camera(kind="ORTHO", ortho_scale=1.0, clip_start=0.01, clip_end=100.0, matrix=eye),
        film=Film(width=size, height=size, passes=["Combined"]),
        settings=Settings(**({"samples": samples, "threads": 1, "integrator": "PHOTON", "max_bounces": 32, "diffuse_bounces": 32,
                          "glossy_bounces": 32, "transmission_bounces": 32} | settings)),
    )  # fmt: skip


def fresnel(cosine: Any, ior: float) -> Any:
    """Reflected part of unpolarised light that meets an interface; ior: of the far side to the near one."""
    c = np.asarray(cosine, np.float64)
    g2 = ior * ior - 1.0 + c * c
    g = np.sqrt(np.maximum(g2, 0.0))
    part = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
    return np.where(g2 < 0.0, 1.0, part)


def radiance_seen() -> float:
    """Of the floor's middle, were floor and sheet endless.

    As in Cycles, radiance is the same on both sides of glass: below, where rays lie closer, there is less light in all.
    """
    down = 1.0 - float(fresnel(1.0, IOR))
    # What the floor sends up comes back from below the sheet by this part: the mean over a cosine's hemisphere.
    cosine2 = (np.arange(4000) + 0.5) / 4000
    back = float(fresnel(np.sqrt(cosine2), 1.0 / IOR).mean())
    return down * down / IOR**2 * SUN * ALBEDO / math.pi / (1.0 - ALBEDO * back)

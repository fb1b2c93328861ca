"""Figures of rows 42, 43, 45 to 53 of the hard cases: lamps, worlds and textures over a floor of albedo 0.5; glass."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F32, Camera, Image, Light, Mesh, Scene, World
from luch.shader import ProgramBuilder, float_word

from support.accel_meshes import icosphere
from support.effects import program
from support.hard_geometry import quad
from support.hard_scenes import at, diffuse, glass, looking, mesh_of, picture, scene_of

HIGH_RES = (1024, 512)


def lit_floor(lights: list[Light], *, world: float = 0.0, samples: int = 256, **settings: Any) -> Scene:
    """A spot of a wide floor, a millimetre across, seen from above."""
    eye = looking((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    camera = Camera(kind="ORTHO", matrix=eye, ortho_scale=1e-3)
    return scene_of([quad(2000.0)], [diffuse(0.5)], camera=camera, lights=lights, world=world, samples=samples,
                    bounces=1, size=(4, 4), **settings)  # fmt: skip


def world_of(pixels: F32) -> tuple[World, list[Image]]:
    """A world that shows an image around."""

    def build(b: ProgramBuilder) -> None:
        direction = b.op3("POINT_POSITION", (), (float_word(0.0),) * 3)
        red, green, blue, _ = b.op("ENVIRONMENT", direction, (b.image(0), 0, 0))
        b.closure("CLOSURE_EMISSION", (red, green, blue))

    return World("World", program(build)), [Image("Sky", pixels)]


def sky_over_floor(pixels: F32, **settings: Any) -> Scene:
    scene = lit_floor([], **settings)
    scene.world, scene.images = world_of(pixels)
    return scene


def hot_texel(value: float) -> tuple[F32, float]:
    """A sky of 1024 by 512 that is black but for one texel; what a floor of albedo 0.5 sends back of it."""
    width, height = HIGH_RES
    pixels = np.zeros((height, width, 3), np.float32)
    x, y = 700, 400  # rows from below: some 50 degrees over the horizon
    pixels[y, x] = value
    # Between the centres of texels the picture is linear: a tent around this one, whose light is its integral.
    n = 64
    fine = (np.arange(2 * n) + 0.5) / n - 1.0
    tent = 1.0 - np.abs(fine)
    polar = (y + 0.5 + fine) / height * np.pi  # from straight down
    column = (tent * np.sin(polar) * -np.cos(polar)).sum() / n * np.pi / height
    irradiance = value * column * tent.sum() / n * 2.0 * np.pi / width
    return pixels, 0.5 * irradiance / np.pi


def nested_dielectrics(kind: str, **settings: Any) -> F32:
    """Water in a glass shell in a furnace: "overlap", "gap", "coincident", or seen from "inside" the water."""
    points, triangles = icosphere(3)

    def ball(name: str, radius: float, inwards: bool = False) -> Mesh:
        return mesh_of(
            name, ((points * np.float32(radius)).astype(np.float32), triangles[:, :: -1 if inwards else 1].copy())
        )

    water = {"overlap": 0.714, "gap": 0.686, "coincident": 0.7, "inside": 0.7}[kind]
    eye = looking((0.1, 0.2, 9.0), (0.1, 0.2, 0.0))
    camera = Camera(kind="ORTHO", matrix=eye, ortho_scale=2.4)
    if kind == "inside":
        camera = Camera(kind="EQUIRECTANGULAR", matrix=at((0.05, 0.02, 0.1)), clip_start=1e-3)
    meshes = [ball("Glass", 1.0), ball("Cavity", 0.7, inwards=True), ball("Water", water)]
    # Between flat facets a path may be reflected within for long.
    return picture(scene_of(meshes, [glass(1.5), glass(1.5), glass(1.33)], camera=camera, bounces=2048, **settings))


def glass_against_nothing(ior: float, roughness: float, **settings: Any) -> float:
    """Root mean square of what a ball of glass changes in a furnace."""
    eye = looking((0.1, 0.2, 9.0), (0.1, 0.2, 0.0))
    camera = Camera(kind="ORTHO", matrix=eye, ortho_scale=3.0)
    ball = mesh_of("Ball", icosphere(3))
    pixels = picture(scene_of([ball], [glass(ior, roughness)], camera=camera, bounces=512, **settings))
    return float(np.sqrt(np.mean((pixels.astype(np.float64) - 1.0) ** 2)))

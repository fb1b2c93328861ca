"""Surfaces at their limits, through whole renders. Numbers: the rows of the list of hard cases.

Rows 40, 41 and 62 (reciprocity, sample = density, cosines beyond 1) need no picture: test_closures.py and
test_closure_samples.py hold them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from luch.scene import Camera, Film, Instances, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder
from support import accel_meshes
from support.asked import every_device
from support.closures import ROUGHNESS
from support.hard_scenes import picture

SIZE = 12  # pixels
GGX, BECKMANN, MULTI_GGX = 0, 1, 2  # the order of Microfacets in bsdf/params.h


def glass(roughness: float, ior: float = 1.5, distribution: int = MULTI_GGX) -> Material:
    b = ProgramBuilder()
    zero = b.constant(0.0)
    numbers = (b.constant(roughness), b.constant(ior))
    film = (zero, b.constant(1.33))
    inputs = (*b.vector(1.0, 1.0, 1.0), *numbers, zero, zero, zero, *film)
    b.closure("CLOSURE_GLASS", b.vector(1.0, 1.0, 1.0), inputs, (1, distribution))
    return Material("Glass", b.finish())


def metal(roughness: float) -> Material:
    b = ProgramBuilder()
    zero, one = b.constant(0.0), b.vector(1.0, 1.0, 1.0)
    inputs = (*one, b.constant(roughness), *[zero] * 8)
    b.closure("CLOSURE_GLOSSY", one, inputs, (1, MULTI_GGX))
    return Material("Metal", b.finish())


def icosphere(level: int) -> Mesh:
    vertices, triangles = accel_meshes.icosphere(level)
    return Mesh("Ball", vertices, triangles, np.zeros(len(triangles), np.uint16))


def scene_of(
    mesh: Mesh, material: Material, camera: Camera, samples: int, light: float = 1.0, device: str = "CPU"
) -> Scene:
    """The mesh in an even white world."""
    sky = ProgramBuilder()
    sky.closure("CLOSURE_EMISSION", sky.vector(light, light, light))
    bounces = 512
    settings = Settings(samples=samples, threads=1, device=device, max_bounces=bounces, min_light_bounces=bounces)
    settings.diffuse_bounces = settings.glossy_bounces = settings.transmission_bounces = bounces
    return Scene(
        meshes=[mesh],
        objects=[Object(mesh.name, 0, [0])],
        materials=[material],
        instances=Instances(
            object=np.zeros(1, np.uint32),
            matrix=np.eye(3, 4)[None],
            random=np.zeros(1, np.float32),
            generated=np.zeros((1, 3), np.float32),
            uv=np.zeros((1, 2), np.float32),
        ),
        world=World("World", sky.finish()),
        camera=camera,
        film=Film(width=SIZE, height=SIZE),
        settings=settings,
    )


def above(scale: float) -> Camera:
    """Straight down on the origin, `scale` metres across."""
    matrix = np.eye(3, 4)
    matrix[2, 3] = 10.0
    return Camera(kind="ORTHO", ortho_scale=scale, matrix=matrix)


def plane_at(degrees: float) -> tuple[Mesh, Camera]:
    """A huge square in z = 0, and a camera that sees nothing else under the angle to its normal."""
    a = math.radians(degrees)
    corners = np.float32([[-1e3, -1e3, 0], [1e3, -1e3, 0], [1e3, 1e3, 0], [-1e3, 1e3, 0]])
    mesh = Mesh("Plane", corners, np.uint32([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.uint16))
    c, s = math.cos(a), math.sin(a)
    matrix = np.array([[c, 0, s, 10 * s], [0, 1, 0, 0], [-s, 0, c, 10 * c]])
    return mesh, Camera(kind="ORTHO", ortho_scale=1.0, matrix=matrix)


@every_device
@pytest.mark.parametrize("degrees", [0.0, 60.0, 85.0])
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_38_a_white_mirror_is_white_at_every_roughness_and_angle(roughness: float, degrees: float, device: str) -> None:
    mesh, camera = plane_at(degrees)
    mean = picture(scene_of(mesh, metal(roughness), camera, samples=64, device=device)).mean()
    print(f"roughness {roughness}, {degrees} degrees: {mean - 1.0:+.4f}")
    assert mean == pytest.approx(1.0, abs=2e-3)


@every_device
@pytest.mark.parametrize(("roughness", "tolerance"), [(0.0, 1e-4), (0.2, 2e-3), (0.5, 5e-3), (1.0, 5e-3)])
def test_39_closed_glass_loses_no_light(roughness: float, tolerance: float, device: str) -> None:
    mesh = icosphere(3)
    mean = picture(scene_of(mesh, glass(roughness), above(1.2), samples=48, device=device)).mean()
    print(f"roughness {roughness}: {mean - 1.0:+.4f}")
    assert mean == pytest.approx(1.0, abs=tolerance)


@every_device
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_42_glass_of_index_one_cannot_be_seen(roughness: float, device: str) -> None:
    pixels = picture(scene_of(icosphere(3), glass(roughness, ior=1.0), above(3.0), samples=16, device=device))
    assert np.sqrt(np.mean((pixels - 1.0) ** 2)) <= 1e-6


@every_device
@pytest.mark.parametrize("ior", [0.0, 1e-3, 0.5, 0.9999, 1.0, 1.00005, 1.0001, 1.001, 10.0, 1e6])
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_42_no_index_makes_light(roughness: float, ior: float, device: str) -> None:
    pixels = picture(scene_of(icosphere(2), glass(roughness, ior, GGX), above(2.5), samples=8, device=device))
    assert np.isfinite(pixels).all()
    assert pixels.mean() <= 1.001


@every_device
@pytest.mark.parametrize("make", [glass, metal])
def test_44_tiny_roughness_looks_like_none(make: Callable[[float], Material], device: str) -> None:
    smooth, tiny, small = (
        picture(scene_of(icosphere(3), make(r), above(2.5), samples=8, light=0.5, device=device))
        for r in (0.0, 1e-6, 1e-3)
    )
    assert np.abs(tiny - smooth).max() <= 1e-3
    assert np.abs(small - smooth).max() <= 1e-3

"""Scenes of the list of hard cases that tests and the bench share: rooms, planes and stacks in an even or black world.

Lengths in metres. `place` is where a thing stands; with mode "vertices" it is added to the mesh's own coordinates
(which are single precision), with mode "object" to the transform (double, as the exporter hands it over).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from luch.render import render
from luch.scene import (
    F32,
    F64,
    Camera,
    Film,
    Instances,
    Light,
    Material,
    Mesh,
    Object,
    Scene,
    Settings,
    World,
)
from luch.shader import ProgramBuilder

from support import accel_meshes
from support.effects import closure, program

Build = Callable[[ProgramBuilder], None]
Place = tuple[float, float, float]
HERE: Place = (0.0, 0.0, 0.0)
MULTI_GGX = 2  # of Microfacets in bsdf/params.h


def diffuse(albedo: float = 1.0) -> Material:
    return Material("Diffuse", program(lambda b: closure(b, "CLOSURE_DIFFUSE", {"color": (albedo,) * 3})))


def glass(ior: float = 1.5, roughness: float = 0.0, distribution: int = MULTI_GGX) -> Material:
    def build(b: ProgramBuilder) -> None:
        zero = b.constant(0.0)
        inputs = (
            *b.vector(1.0, 1.0, 1.0),
            b.constant(roughness),
            b.constant(ior),
            zero,
            zero,
            zero,
            zero,
            b.constant(1.33),
        )
        b.closure("CLOSURE_GLASS", b.vector(1.0, 1.0, 1.0), inputs, (1, distribution))

    return Material("Glass", program(build))


def mirror(roughness: float = 0.0) -> Material:
    def build(b: ProgramBuilder) -> None:
        zero, one = b.constant(0.0), b.vector(1.0, 1.0, 1.0)
        b.closure("CLOSURE_GLOSSY", one, (*one, b.constant(roughness), *[zero] * 8), (1, MULTI_GGX))

    return Material("Mirror", program(build))


def glow(strength: float = 10.0) -> Material:
    return Material("Glow", program(lambda b: closure(b, "CLOSURE_EMISSION", {}, weight=(strength,) * 3)))


def even_world(strength: float = 1.0) -> World:
    return World("World", program(lambda b: closure(b, "CLOSURE_EMISSION", {}, weight=(strength,) * 3)))


def mesh_of(name: str, mesh: accel_meshes.Mesh) -> Mesh:
    return Mesh(name, mesh[0], mesh[1], np.zeros(len(mesh[1]), np.uint16))


def at(place: Place, size: float | Sequence[float] = 1.0) -> F64:
    """A transform that stretches along the axes, then moves."""
    matrix = np.zeros((3, 4))
    matrix[:, :3] = np.diag(np.broadcast_to(np.asarray(size, np.float64), 3))
    matrix[:, 3] = place
    return matrix


def looking(eye: Sequence[float], towards: Sequence[float], up: Sequence[float] = (0.0, 0.0, 1.0)) -> F64:
    """A camera's transform."""
    z = np.asarray(eye, np.float64) - np.asarray(towards, np.float64)
    z /= np.linalg.norm(z)
    x = np.cross(np.asarray(up, np.float64), z)
    if not np.linalg.norm(x) > 1e-6:
        x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z, np.asarray(eye, np.float64)])


def instances_of(which: Sequence[int], matrices: Any) -> Instances:
    count = len(which)
    return Instances(
        np.asarray(which, np.uint32), np.asarray(matrices, np.float64).reshape(count, 3, 4), np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip


def scene_of(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    matrices: Sequence[F64] | None = None,
    *,
    camera: Camera,
    world: float = 1.0,
    size: tuple[int, int] = (16, 16),
    samples: int = 4,
    bounces: int = 8,
    lights: Sequence[Light] = (),
    origin: Place | None = None,
    **settings: Any,
) -> Scene:
    """Mesh k stands at matrix k and shows material k (the last one, where there are fewer).

    The scene's origin is the camera's place, as the exporter sets it, if none is given.
    """
    count = len(meshes)
    own = Settings(samples=samples, max_bounces=bounces, min_light_bounces=bounces, min_transparent_bounces=bounces,
                   diffuse_bounces=bounces, glossy_bounces=bounces, transmission_bounces=bounces, accelerator="BVH",
                   transparent_bounces=1024, estimate_error=False)  # fmt: skip
    for name, value in settings.items():
        assert hasattr(own, name), name
        setattr(own, name, value)
    eye = camera.matrix[:, 3]
    return Scene(
        meshes=list(meshes),
        objects=[Object(mesh.name, k, [min(k, len(materials) - 1)]) for k, mesh in enumerate(meshes)],
        materials=list(materials),
        instances=instances_of(range(count), [np.eye(3, 4)] * count if matrices is None else matrices) if count else None,
        lights=list(lights),
        world=even_world(world) if world > 0.0 else None,
        camera=camera,
        film=Film(width=size[0], height=size[1]),
        settings=own,
        origin=(float(eye[0]), float(eye[1]), float(eye[2])) if origin is None else origin,
    )  # fmt: skip


def picture(scene: Scene) -> F32:
    """Combined's colours, (H, W, 3). Fails on samples that are not finite."""
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0, result.stats["non_finite_samples"]
    pixels = result.passes["Combined"][..., :3]
    assert np.isfinite(pixels).all()
    return pixels

"""Emitters that lie in one place light a scene once: a ray can only ever meet the first of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from luch.render import render
from luch.scene import Camera, Film, Instances, Material, Mesh, Object, Scene, Settings
from luch.shader import ProgramBuilder


def _material(name: str, build: Callable[[ProgramBuilder], None], estimate: float) -> Material:
    builder = ProgramBuilder()
    build(builder)
    return Material(name, builder.finish(), emission_estimate=(estimate,) * 3)


def _scene(copies: int) -> Scene:
    """A diffuse floor under `copies` coincident glowing quads, seen from above the floor."""
    quad = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    slots = np.zeros(2, np.uint16)

    def glow(b: ProgramBuilder) -> None:
        three = b.constant(3.0)
        b.closure("CLOSURE_EMISSION", (three, three, three))

    def grey(b: ProgramBuilder) -> None:
        one, half, zero = b.constant(1.0), b.constant(0.5), b.constant(0.0)
        b.closure("CLOSURE_DIFFUSE", (one, one, one), (half, half, half, zero, zero, zero, zero), (1,))

    scene = Scene(materials=[_material("glow", glow, 3.0), _material("grey", grey, 0.0)])
    scene.meshes = [Mesh("floor", quad * 10, triangles, slots), Mesh("lamp", quad, triangles, slots)]
    scene.objects = [Object("floor", 0, [1])] + [Object(f"lamp{i}", 1, [0]) for i in range(copies)]
    matrices = np.tile(np.eye(3, 4), (copies + 1, 1, 1))
    matrices[1:, 2, 3] = 1.0
    count = copies + 1
    scene.instances = Instances(
        np.arange(count, dtype=np.uint32),
        matrices,
        np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32),
        np.zeros((count, 2), np.float32),
    )
    view = np.eye(3, 4)
    view[:, 3] = (3.0, 0.0, 0.5)
    scene.camera = Camera(kind="ORTHO", matrix=view, ortho_scale=1.0, clip_start=0.01)
    scene.film = Film(width=8, height=8)
    scene.settings = Settings(samples=256, max_bounces=1)
    return scene


@pytest.mark.parametrize("copies", [2, 3])
def test_coincident_emitters_light_as_one(copies: int) -> None:
    alone = render(_scene(1)).passes["Combined"][..., :3].mean()
    together = render(_scene(copies)).passes["Combined"][..., :3].mean()
    assert alone > 0.01
    assert together == pytest.approx(alone, rel=0.02)

"""The Mist pass: depth from the camera, or from an orthographic camera's plane, as Cycles has it."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_mist_is_that_of_cycles(
    scene: bpy.types.Scene, render_passes: Callable[..., dict[str, NDArray[np.float32]]], kind: str
) -> None:
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 5.0)
    camera.data.type = kind
    camera.data.ortho_scale = 8.0
    camera.data.lens = 20.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 2.0, 8.0
    scene.view_layers[0].use_pass_mist = True
    ours = render_passes("LUCH", width=32, height=32, samples=64)["Mist"]
    cycles = render_passes("CYCLES", width=32, height=32, samples=64)["Mist"]
    assert cycles.max() > 0.1
    np.testing.assert_allclose(ours, cycles, atol=2e-3)  # what filtering with other random numbers leaves

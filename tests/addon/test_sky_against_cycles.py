"""A sky with a sun over the ground: brightness as in Cycles, and no more noise."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

F32 = NDArray[np.float32]
SIZE, SAMPLES = 24, 16


@pytest.fixture
def ground_under_sky(scene: bpy.types.Scene) -> bpy.types.ShaderNodeTexSky:
    """A grey plane that fills the picture; the sky's node."""
    bpy.ops.mesh.primitive_plane_add(size=20)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 4.0
    viewer = bpy.data.objects.new("Camera", camera)
    viewer.location = (0.0, 0.0, 5.0)
    scene.collection.objects.link(viewer)
    scene.camera = viewer
    scene.world = bpy.data.worlds.new("World")
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation = 0.6, 0.7
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.1
    return sky


@pytest.mark.parametrize("kind", ["MULTIPLE_SCATTERING", "SINGLE_SCATTERING"])
@pytest.mark.parametrize("sun_size", [0.0095, 0.3])
def test_sunlit_ground_is_as_bright_and_as_smooth_as_in_cycles(
    ground_under_sky: bpy.types.ShaderNodeTexSky, render: Callable[..., F32], kind: str, sun_size: float
) -> None:
    ground_under_sky.sky_type, ground_under_sky.sun_size = kind, sun_size
    cycles, luch = (render(engine, width=SIZE, height=SIZE, samples=SAMPLES) for engine in ("CYCLES", "LUCH"))
    means = [picture[..., :3].mean(axis=(0, 1)) for picture in (cycles, luch)]
    np.testing.assert_allclose(means[1], means[0], rtol=0.01)
    noise = [float(picture[..., :3].std() / picture[..., :3].mean()) for picture in (cycles, luch)]
    colour = [float(mean.std() / mean.mean()) for mean in means]  # the part of the spread that is no noise
    assert noise[1] - colour[1] < 2.0 * (noise[0] - colour[0]) + 0.01


def test_a_sun_below_the_horizon_lights_nothing_from_below(
    ground_under_sky: bpy.types.ShaderNodeTexSky, render: Callable[..., F32]
) -> None:
    ground_under_sky.sun_elevation = -0.2
    cycles, luch = (render(engine, width=SIZE, height=SIZE, samples=SAMPLES) for engine in ("CYCLES", "LUCH"))
    means = [picture[..., :3].mean(axis=(0, 1)) for picture in (cycles, luch)]
    assert np.isfinite(luch).all()
    np.testing.assert_allclose(means[1], means[0], rtol=0.02, atol=1e-5)

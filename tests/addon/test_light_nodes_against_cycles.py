"""Nodes of worlds and lamps against Cycles: what input nodes give where there is no surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

Render = Callable[..., NDArray[np.float32]]

INPUTS = [
    *(
        ("ShaderNodeTexCoord", name)
        for name in ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
    ),
    *(("ShaderNodeNewGeometry", name) for name in ("Position", "Normal", "Incoming", "Parametric", "Backfacing")),
    *(("ShaderNodeLightPath", name) for name in ("Is Camera Ray", "Ray Length", "Ray Depth")),
    *(("ShaderNodeCameraData", name) for name in ("View Vector", "View Z Depth", "View Distance")),
    ("ShaderNodeObjectInfo", "Random"),
]
LAMP_INPUTS = [
    ("ShaderNodeTexCoord", "Object"),
    ("ShaderNodeTexCoord", "Normal"),
    ("ShaderNodeTexCoord", "UV"),
    ("ShaderNodeNewGeometry", "Position"),
    ("ShaderNodeNewGeometry", "Incoming"),
    ("ShaderNodeLightFalloff", "Linear"),
    ("ShaderNodeLightPath", "Ray Length"),
    ("ShaderNodeLightPath", "Ray Depth"),
]


def add_camera(scene: Any) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.data.lens = (1.0, -2.0, 3.0), (1.2, 0.3, 0.7), 20.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.luch.pixel_filter_type, scene.luch.filter_width = "GAUSSIAN", 0.01
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01


def show(tree: Any, output_kind: str, shader_kind: str, node_kind: str, socket: str) -> None:
    """The output of one node as the colour of the light."""
    tree.nodes.clear()
    output, shader = tree.nodes.new(output_kind), tree.nodes.new(shader_kind)
    tree.links.new(shader.outputs[0], output.inputs[0])
    tree.links.new(tree.nodes.new(node_kind).outputs[socket], shader.inputs["Color"])


@pytest.mark.parametrize(("node", "socket"), INPUTS)
def test_a_world_shows_what_cycles_shows(scene: Any, render: Render, node: str, socket: str) -> None:
    add_camera(scene)
    scene.world = bpy.data.worlds.new("World")
    show(scene.world.node_tree, "ShaderNodeOutputWorld", "ShaderNodeBackground", node, socket)
    cycles, luch = (render(engine, width=16, height=12, samples=1) for engine in ("CYCLES", "LUCH"))
    np.testing.assert_allclose(luch, cycles, atol=2e-3, rtol=1e-3)


@pytest.mark.parametrize(
    ("kind", "node", "socket"), [(kind, *pair) for kind in ("POINT", "AREA", "SUN") for pair in LAMP_INPUTS]
)
def test_a_lamp_shines_as_in_cycles(scene: Any, render: Render, kind: str, node: str, socket: str) -> None:
    add_camera(scene)
    ground = bpy.data.meshes.new("Ground")
    ground.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("Ground", ground))
    lamp = bpy.data.lights.new("Lamp", kind)
    lamp.energy, lamp.use_nodes = 3.0 if kind == "SUN" else 300.0, True
    if kind == "AREA":
        lamp.size = 1.5
    if kind == "POINT":
        lamp.shadow_soft_size = 0.3
    show(lamp.node_tree, "ShaderNodeOutputLight", "ShaderNodeEmission", node, socket)
    placed = bpy.data.objects.new("Lamp", lamp)
    placed.location, placed.rotation_euler = (0.0, 1.0, 2.0), (0.3, 0.4, 0.2)
    scene.collection.objects.link(placed)
    scene.cycles.max_bounces = 0
    cycles, luch = (render(engine, width=12, height=9, samples=64)[..., :3] for engine in ("CYCLES", "LUCH"))
    apart = np.abs(luch - cycles) / np.maximum(1.0, np.abs(cycles))
    assert np.median(apart) < 2e-3
    means_apart = np.abs(
        luch.mean(axis=(0, 1)) - cycles.mean(axis=(0, 1))
    )  # by channel: u and v may err against each other
    assert (means_apart < 5e-3 * np.abs(cycles).mean(axis=(0, 1)).max() + 1e-4).all()

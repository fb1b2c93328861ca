"""Shadow Terminator > Geometry Offset against Cycles: where shadow rays leave smooth-shaded low-poly surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Render = Callable[..., F32]
SIZE = 48


def add(scene: bpy.types.Scene, name: str, data: Any) -> bpy.types.Object:
    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    return thing


def give(mesh: bpy.types.Mesh, closure: str) -> None:
    """A material of one closure."""
    material = bpy.data.materials.new(closure)
    tree = material.node_tree
    tree.nodes.clear()
    output, node = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new(closure)
    tree.links.new(node.outputs[0], output.inputs[0])
    mesh.materials.append(material)


def add_camera(scene: bpy.types.Scene, height: float) -> None:
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 2.4
    scene.camera = add(scene, "Camera", camera)
    scene.camera.location.z = height
    if height < 0.0:
        scene.camera.rotation_euler.x = math.pi
    for settings in (scene.luch, scene.cycles):  # both engines see the same points
        settings.pixel_filter_type, settings.filter_width = "GAUSSIAN", 0.01
    scene.cycles.max_bounces = 0


def add_sun(scene: bpy.types.Scene, *turns: float) -> None:
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.0
    add(scene, "Sun", sun).rotation_euler = turns


def differing(render: Render) -> float:
    """Share of the pixels in which the engines differ; some lie on the edge of a shadow."""
    cycles, luch = (render(engine, width=SIZE, height=SIZE, samples=1)[..., :3] for engine in ("CYCLES", "LUCH"))
    assert cycles.max() > 0.0
    return float((np.abs(luch - cycles).max(axis=2) > 2e-3).mean())


@pytest.mark.parametrize("closure", ["ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent"])
@pytest.mark.parametrize("offset", [0.0, 0.1, 0.5])
def test_a_coarse_smooth_ball_is_lit_as_in_cycles(
    scene: bpy.types.Scene, render: Render, closure: str, offset: float
) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    bpy.ops.object.shade_smooth()
    ball = bpy.context.object
    ball.scale = (1.2, 1.2, 1.2)
    ball.shadow_terminator_geometry_offset = offset
    give(ball.data, closure)
    bpy.ops.mesh.primitive_plane_add(size=9.0, location=(0.0, 0.0, -1.3))
    add_camera(scene, 5.0)
    add_sun(scene, 0.0, math.radians(80.0), 0.3)
    assert differing(render) < 0.01


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("tilt", [-0.5, 0.5])
def test_a_shadow_falls_on_the_surface_that_the_normals_speak_of(
    scene: bpy.types.Scene, render: Render, behind: bool, tilt: float
) -> None:
    corners = np.array([(-1.0, -0.6, 0.0), (1.0, -0.6, 0.0), (0.0, 1.1, 0.0)])
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2)])
    mesh.polygons[0].use_smooth = True
    normals = corners * tilt + (0.0, 0.0, 1.0)
    mesh.normals_split_custom_set((normals / np.linalg.norm(normals, axis=1, keepdims=True)).tolist())
    give(mesh, "ShaderNodeBsdfDiffuse")
    triangle = add(scene, "Triangle", mesh)
    triangle.shadow_terminator_geometry_offset = 1.0
    triangle.scale = (0.8, 0.8, 0.8)
    side = -1.0 if behind else 1.0
    shade = bpy.data.meshes.new("Shade")
    edge = -0.5 * side  # the shadow's edge crosses the triangle's middle
    shade.from_pydata([(x, y, 0.4 * side) for x, y in ((-3, -3), (edge, -3), (edge, 3), (-3, 3))], [], [(0, 1, 2, 3)])
    add(scene, "Shade", shade).visible_camera = False
    add_camera(scene, 5.0 * side)
    add_sun(scene, math.pi if behind else 0.0, math.radians(-55.0), 0.0)
    assert differing(render) < 0.01

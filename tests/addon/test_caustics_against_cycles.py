"""Reflective and Refractive Caustics, switch by switch: indirect light of a closed room against Cycles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

RenderPasses = Callable[..., dict[str, NDArray[np.float32]]]
PASSES = ("diffuse_direct", "diffuse_indirect", "diffuse_color")


def room(scene: bpy.types.Scene, **inputs: Any) -> None:
    """Matt walls, a box and a ball of one Principled material, a lamp at the ceiling."""
    matt, shown = bpy.data.materials.new("Matt"), bpy.data.materials.new("Shown")
    matt.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
    for name, value in inputs.items():
        shown.node_tree.nodes["Principled BSDF"].inputs[name.replace("_", " ")].default_value = value
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    bpy.context.object.data.materials.append(matt)
    bpy.ops.mesh.primitive_cube_add(size=1.2, location=(-0.7, 0.5, -1.3), rotation=(0.0, 0.0, 0.4))
    bpy.context.object.data.materials.append(shown)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0.8, 0.2, -1.2), radius=0.7)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(shown)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location = 50.0, 1.5, (0.0, 0.0, 1.9)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens, camera.location, camera.rotation_euler = 20.0, (0.0, -1.9, 0.0), (math.radians(90.0), 0.0, 0.0)
    for thing in (lamp, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 8
    for name in PASSES:
        setattr(scene.view_layers[0], f"use_pass_{name}", True)


@pytest.mark.parametrize(
    ("reflective", "refractive", "inputs"),
    [
        (False, False, {"Metallic": 0.5, "Roughness": 0.4}),
        (False, False, {"Transmission_Weight": 0.5, "Roughness": 0.3}),
        (False, True, {"Coat_Weight": 0.8, "Roughness": 0.5}),
        (True, False, {"Transmission_Weight": 0.5, "Roughness": 0.5}),
    ],
)
def test_light_without_caustics_is_that_of_cycles(
    scene: bpy.types.Scene, render_passes: RenderPasses, reflective: bool, refractive: bool, inputs: dict[str, float]
) -> None:
    room(scene, **inputs)
    scene.cycles.caustics_reflective, scene.cycles.caustics_refractive = reflective, refractive
    ours, theirs = (render_passes(engine, width=24, height=18, samples=128) for engine in ("LUCH", "CYCLES"))
    indirect = [(p["Diffuse Indirect"] * p["Diffuse Color"])[..., :3].mean() for p in (ours, theirs)]
    assert indirect[0] == pytest.approx(indirect[1], rel=0.01)
    assert ours["Combined"][..., :3].mean() == pytest.approx(theirs["Combined"][..., :3].mean(), rel=0.01)

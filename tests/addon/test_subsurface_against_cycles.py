"""Light under the surface beside Cycles: the same walks in the same media, so the same picture but for noise.

Each case is a small object under a lamp from behind and a grey world; two renders of each engine tell bias from noise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from support import pictures
from support.objects import Render

SIZE, SAMPLES, CYCLES_SAMPLES = 32, 128, 96
SKIN = (0.8, 0.45, 0.3)
MAX_BIAS, MAX_ENERGY_ERROR = 1e-3, 0.01


def material(kind: str, menu: str = "RANDOM_WALK", **inputs: Any) -> bpy.types.Material:
    """kind: Principled or Subsurface; inputs by the node's names, with underscores for blanks."""
    made = bpy.data.materials.new("Skin")
    tree = made.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeBsdfPrincipled" if kind == "Principled" else "ShaderNodeSubsurfaceScattering")
    setattr(node, "subsurface_method" if kind == "Principled" else "falloff", menu)
    for name, value in inputs.items():
        label = name.replace("_", " ")
        node.inputs[label].default_value = (*value, 1.0) if node.inputs[label].type == "RGBA" else value
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made


def sphere(skin: bpy.types.Material, size: Any = (1.0, 1.0, 1.0)) -> bpy.types.Object:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=16)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    ball.scale = size
    ball.data.materials.append(skin)
    return ball


def slab(skin: bpy.types.Material) -> bpy.types.Object:
    bpy.ops.mesh.primitive_cube_add()
    made = bpy.context.object
    made.matrix_world = Matrix.Rotation(0.5, 4, "Y") @ Matrix.Diagonal((1.2, 1.2, 0.05, 1.0))
    made.data.materials.append(skin)
    return made


def instances() -> None:
    """One mesh three times, stretched and mirrored; the three meet."""
    first = sphere(material("Subsurface", **WIDE), (0.5, 0.5, 0.5))
    for at, size in (((0.5, 0.6, 0.1), (0.8, 0.3, 0.5)), ((-0.6, -0.6, -0.1), (0.4, -0.3, 0.5))):
        copy = bpy.data.objects.new("Copy", first.data)
        copy.location, copy.scale, copy.rotation_euler = at, size, (0.3, 0.5, 0.2)
        bpy.context.scene.collection.objects.link(copy)


def bumped(skin: bpy.types.Material) -> bpy.types.Material:
    tree = skin.node_tree
    node = next(n for n in tree.nodes if "Normal" in n.inputs)
    noise, bump = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBump")
    noise.inputs["Scale"].default_value, bump.inputs["Distance"].default_value = 6.0, 0.3
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    return skin


def light_and_look(scene: bpy.types.Scene) -> None:
    """A square lamp behind to the left, a dim world, a camera from above."""
    bpy.ops.object.light_add(type="AREA", location=(-3.0, 1.0, -2.0))
    lamp = bpy.context.object
    lamp.data.energy, lamp.data.size = 600.0, 1.5
    lamp.rotation_euler = lamp.location.to_track_quat("Z", "Y").to_euler()
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    background = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs[0].default_value, background.inputs[1].default_value = (0.5, 0.6, 0.7, 1.0), 0.6
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 75.0


def same_picture(name: str, render: Render, samples: int = SAMPLES, cycles_samples: int = CYCLES_SAMPLES) -> None:
    ours, theirs = (
        [render(engine, width=SIZE, height=SIZE, samples=count, seed=seed) for seed in (1, 2)]
        for engine, count in (("LUCH", samples), ("CYCLES", cycles_samples))
    )
    mean = [(pair[0] + pair[1]) / 2 for pair in (ours, theirs)]
    weight = (np.abs(mean[1][..., :3].astype(np.float64)) + 0.01) ** 2
    a, b = (np.float64(ours[k][..., :3]) - np.float64(theirs[k][..., :3]) for k in (0, 1))
    bias = float(np.mean(a * b / weight))
    spread = float((a * b / weight).std() / np.sqrt(a.size))
    energy = pictures.energy_ratio(mean[0], mean[1])
    uncertain = sum(np.square(pair[0] - pair[1]).sum(axis=(0, 1)) / 4.0 for pair in (ours, theirs)) ** 0.5
    uncertain = uncertain[:3] / mean[1].sum(axis=(0, 1))[:3]
    noise = [pictures.rel_mse(pair[0], pair[1]) / 2 for pair in (ours, theirs)]
    print(
        f"{name}: bias {bias:.1e} +- {spread:.0e}, energy {energy} +- {uncertain}, noise {noise[0]:.1e} and {noise[1]:.1e}"
    )
    assert np.isfinite(mean[0]).all()
    pictures.assert_pictures_agree(name, mean[0], mean[1], tolerance=MAX_BIAS, measure=bias - 3.0 * spread)
    assert (np.abs(energy - 1.0) <= MAX_ENERGY_ERROR + 2.0 * uncertain).all(), (energy, uncertain)


WIDE = {"Color": SKIN, "Scale": 0.3, "Radius": (1.0, 0.5, 0.25)}
CASES: dict[str, Callable[[], object]] = {
    "sphere": lambda: sphere(material("Subsurface", **WIDE)),
    "slab lit from behind": lambda: slab(material("Subsurface", Color=SKIN, Scale=0.1, Radius=(1.0, 0.5, 0.25))),
    "skin": lambda: sphere(material("Subsurface", "RANDOM_WALK_SKIN", **WIDE)),
    "legacy": lambda: sphere(material("Subsurface", "RANDOM_WALK_LEGACY", **{**WIDE, "Scale": 2.0})),
    "forward": lambda: sphere(material("Subsurface", **WIDE, Anisotropy=0.8)),
    "backward": lambda: sphere(material("Subsurface", **WIDE, Anisotropy=-0.6)),
    "skin forward": lambda: slab(material("Subsurface", "RANDOM_WALK_SKIN", **WIDE, Anisotropy=0.7)),
    "smooth entry": lambda: sphere(material("Subsurface", **WIDE, Roughness=0.1, IOR=1.6)),
    "mixed": lambda: sphere(
        material("Principled", Base_Color=SKIN, Subsurface_Weight=0.6, Subsurface_Radius=(1.0, 0.4, 0.2),
                 Subsurface_Scale=0.4, Roughness=0.4)
    ),
    "principled skin": lambda: sphere(
        material("Principled", "RANDOM_WALK_SKIN", Base_Color=SKIN, Subsurface_Weight=1.0, Subsurface_Scale=0.3,
                 Subsurface_IOR=1.6, Coat_Weight=0.5, Metallic=0.2)
    ),
    "burley": lambda: sphere(material("Subsurface", "BURLEY", **{**WIDE, "Scale": 1.0})),
    "instances": instances,
    "bump": lambda: sphere(bumped(material("Subsurface", **WIDE))),
    "stretched": lambda: sphere(material("Subsurface", **WIDE), (1.0, 0.4, 1.3)),
    "dark and tiny": lambda: sphere(material("Subsurface", Color=(0.9, 0.05, 0.0), Scale=0.05, Radius=(1.0, 0.5, 0.0))),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_it_looks_as_in_cycles(scene: bpy.types.Scene, render: Render, name: str) -> None:
    CASES[name]()
    light_and_look(scene)
    same_picture(name, render)

"""Blender's lamps, emissive meshes and worlds: Luch's picture against Cycles' of the same file."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

Render = Callable[..., NDArray[np.float32]]

LAMPS: dict[str, dict[str, Any]] = {
    "point": {"type": "POINT", "energy": 60.0, "shadow_soft_size": 0.0},
    "soft point": {"type": "POINT", "energy": 60.0, "shadow_soft_size": 0.4},
    "sphere": {"type": "POINT", "energy": 60.0, "shadow_soft_size": 0.4, "use_soft_falloff": False},
    "sphere by radiance": {
        "type": "POINT", "energy": 40.0, "shadow_soft_size": 0.4, "use_soft_falloff": False, "normalize": False,
    },
    "point by radiance": {"type": "POINT", "energy": 60.0, "shadow_soft_size": 0.0, "normalize": False},
    "spot": {"type": "SPOT", "energy": 90.0, "shadow_soft_size": 0.0, "spot_size": 0.9, "spot_blend": 0.4},
    "soft spot": {"type": "SPOT", "energy": 90.0, "shadow_soft_size": 0.3, "spot_size": 0.9},
    "spot sphere": {
        "type": "SPOT", "energy": 90.0, "shadow_soft_size": 0.3, "spot_size": 0.9, "use_soft_falloff": False,
    },
    "sharp spot": {"type": "SPOT", "energy": 90.0, "shadow_soft_size": 0.2, "spot_size": 1.4, "spot_blend": 0.0},
    "sun": {"type": "SUN", "energy": 3.0, "angle": 0.0},
    "wide sun": {"type": "SUN", "energy": 3.0, "angle": 0.6},
    "sun by radiance": {"type": "SUN", "energy": 3.0, "angle": 0.6, "normalize": False},
    "square": {"type": "AREA", "energy": 60.0, "shape": "SQUARE", "size": 1.0},
    "rectangle": {"type": "AREA", "energy": 60.0, "shape": "RECTANGLE", "size": 2.0, "size_y": 0.2},
    "disk": {"type": "AREA", "energy": 60.0, "shape": "DISK", "size": 1.0},
    "ellipse": {"type": "AREA", "energy": 60.0, "shape": "ELLIPSE", "size": 2.0, "size_y": 0.6},
    "square by radiance": {"type": "AREA", "energy": 20.0, "shape": "SQUARE", "size": 1.0, "normalize": False},
    "square with spread": {"type": "AREA", "energy": 60.0, "shape": "SQUARE", "size": 1.0, "spread": 1.0},
    "disk with spread": {"type": "AREA", "energy": 60.0, "shape": "DISK", "size": 1.5, "spread": 0.4},
    "parallel square": {"type": "AREA", "energy": 60.0, "shape": "SQUARE", "size": 1.5, "spread": 0.0},
}  # fmt: skip


def stage(scene: bpy.types.Scene) -> None:
    """A matt floor, a leaning matt card, a camera that sees both."""
    matt = bpy.data.materials.new("Matt")
    matt.use_nodes = True
    tree = matt.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.6, 0.5, 0.4, 1.0)
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    for size, place, turn in ((6.0, (0, 0, 0), (0, 0, 0)), (1.2, (-0.8, 0.6, 0.5), (0.9, 0.3, 0.2))):
        bpy.ops.mesh.primitive_plane_add(size=size, location=place, rotation=turn)
        bpy.context.object.data.materials.append(matt)
    bpy.ops.object.camera_add(location=(0.0, -4.0, 4.0), rotation=(0.75, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.cycles.max_bounces = 0


def add_lamp(scene: bpy.types.Scene, settings: dict[str, Any], **place: Any) -> bpy.types.Object:
    data = bpy.data.lights.new("Lamp", settings["type"])
    for name, value in settings.items():
        if name != "type":
            setattr(data, name, value)
    lamp = bpy.data.objects.new("Lamp", data)
    lamp.location = place.get("location", (0.5, 0.2, 2.0))
    lamp.rotation_euler = place.get("rotation", (0.3, -0.25, 0.4))
    lamp.scale = place.get("scale", (1.0, 1.0, 1.0))
    scene.collection.objects.link(lamp)
    return lamp


def assert_alike(
    ours: NDArray[np.float32], theirs: NDArray[np.float32], mean: float = 6e-3, tile: float = 0.03
) -> None:
    """Means within `mean`; 8x8 tiles within `tile` of the picture's brightest tile: edges and shapes agree."""
    a, b = ours[..., :3].astype(float), theirs[..., :3].astype(float)
    assert np.isfinite(a).all()
    assert b.mean() > 1e-3
    assert a.mean() == pytest.approx(b.mean(), rel=mean)
    tiles = [x.reshape(4, 8, 4, 8, 3).mean((1, 3)) for x in (a, b)]
    assert np.abs(tiles[0] - tiles[1]).max() <= tile * tiles[1].max()


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS.keys())
def test_lamp_lights_a_stage_as_in_cycles(scene: bpy.types.Scene, render: Render, lamp: dict[str, Any]) -> None:
    stage(scene)
    add_lamp(scene, lamp)
    assert_alike(render("LUCH", samples=128), render("CYCLES", samples=128))


@pytest.mark.parametrize("name", ["spot", "soft spot", "square", "ellipse", "wide sun", "sphere"])
def test_scaled_and_mirrored_lamps_light_as_in_cycles(scene: bpy.types.Scene, render: Render, name: str) -> None:
    stage(scene)
    add_lamp(scene, LAMPS[name], scale=(-1.6, 0.7, 1.2))
    assert_alike(render("LUCH", samples=128), render("CYCLES", samples=128))


@pytest.mark.parametrize("name", ["soft point", "sphere", "spot sphere", "rectangle", "ellipse", "square with spread"])
def test_lamps_seen_by_the_camera_look_as_in_cycles(scene: bpy.types.Scene, render: Render, name: str) -> None:
    stage(scene)
    lamp = add_lamp(scene, LAMPS[name], location=(0.0, 0.5, 0.9), rotation=(-0.6, 0.2, 0.0))
    lamp.visible_camera = True
    assert_alike(render("LUCH", samples=128), render("CYCLES", samples=128))


@pytest.mark.parametrize("sampling", ["AUTO", "FRONT", "BACK", "NONE"])
def test_mesh_light_lights_as_in_cycles(scene: bpy.types.Scene, render: Render, sampling: str) -> None:
    stage(scene)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=0.3, location=(0.6, 0.2, 1.0))
    glow = bpy.data.materials.new("Glow")
    glow.use_nodes = True
    tree = glow.node_tree
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (1.0, 0.7, 0.3, 1.0)
    emission.inputs["Strength"].default_value = 8.0
    tree.links.new(emission.outputs[0], output.inputs[0])
    glow.cycles.emission_sampling = sampling
    bpy.context.object.data.materials.append(glow)
    noisy = sampling in ("NONE", "BACK")
    assert_alike(
        render("LUCH", samples=256 if noisy else 128), render("CYCLES", samples=256 if noisy else 128),
        mean=0.02 if noisy else 6e-3, tile=0.06 if noisy else 0.03,
    )  # fmt: skip


@pytest.mark.parametrize("hot", [1.0, 1e4])
def test_image_world_lights_as_in_cycles(scene: bpy.types.Scene, render: Render, hot: float) -> None:
    stage(scene)
    rng = np.random.default_rng(4)
    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., :3] = rng.uniform(0.0, 0.4, (16, 32, 3))
    pixels[11, 9, :3] = hot
    image = bpy.data.images.new("Sky", 32, 16, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    scene.world = world
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    world.node_tree.links.new(texture.outputs[0], world.node_tree.nodes["Background"].inputs[0])
    assert_alike(render("LUCH", samples=128), render("CYCLES", samples=128), mean=8e-3, tile=0.04)


def test_many_lamps_of_all_kinds_light_as_in_cycles(scene: bpy.types.Scene, render: Render) -> None:
    stage(scene)
    for i, lamp in enumerate(LAMPS.values()):
        angle = 2.0 * math.pi * i / len(LAMPS)
        place = (2.2 * math.cos(angle), 2.2 * math.sin(angle), 1.5)
        add_lamp(scene, lamp | {"energy": lamp["energy"] * 0.1}, location=place)
    assert_alike(render("LUCH", samples=128), render("CYCLES", samples=128), mean=8e-3, tile=0.04)


@pytest.mark.parametrize("bounces", [0, 1])
@pytest.mark.parametrize("kind", ["lamp", "world"])
def test_light_of_few_bounces_ends_as_in_cycles(
    scene: bpy.types.Scene, render: Render, kind: str, bounces: int
) -> None:
    stage(scene)
    scene.cycles.max_bounces = 4
    if kind == "lamp":
        lamp: Any = add_lamp(scene, LAMPS["soft point"]).data
        settings = lamp.cycles
    else:
        scene.world = bpy.data.worlds.new("World")
        settings = scene.world.cycles
    endless = render("LUCH", samples=64)[..., :3].mean()
    settings.max_bounces = bounces
    ours = render("LUCH", samples=128)
    assert_alike(ours, render("CYCLES", samples=128), mean=8e-3, tile=0.04)
    if kind == "lamp":  # paths that leave the scene still see the world
        assert ours[..., :3].mean() < (0.9995 if bounces else 0.99) * endless


@pytest.mark.parametrize("limit", [1, 2, 8])
def test_a_shadow_through_veils_ends_as_in_cycles(scene: bpy.types.Scene, render: Render, limit: int) -> None:
    """Its count goes on from that of the path which it left, whatever becomes of the path."""
    veil = bpy.data.materials.new("Veil")
    shader = veil.node_tree.nodes["Principled BSDF"]
    shader.inputs["Alpha"].default_value, shader.inputs["Specular IOR Level"].default_value = 0.5, 0.0
    for height in range(4):
        bpy.ops.mesh.primitive_plane_add(size=40.0, location=(0.0, 0.0, height))
        if height:
            bpy.context.object.data.materials.append(veil)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 10.0))
    scene.camera = bpy.context.object
    add_lamp(scene, LAMPS["sun"])
    scene.cycles.max_bounces, scene.cycles.transparent_max_bounces = 0, limit
    ours, theirs = (render(engine, width=8, height=8, samples=256)[..., :3].mean() for engine in ("LUCH", "CYCLES"))
    assert ours == pytest.approx(theirs, rel=0.01)


def test_a_glowing_box_that_casts_no_shadow_shines_through_itself(scene: bpy.types.Scene, render: Render) -> None:
    """How much is a matter of sampling, in Cycles too: rays that find the box see its near faces alone."""
    stage(scene)
    bpy.ops.mesh.primitive_cube_add(location=(1.0, 0.0, 1.5))
    box = bpy.context.object
    glow = bpy.data.materials.new("Glow")
    shader = glow.node_tree.nodes["Principled BSDF"]
    shader.inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    shader.inputs["Emission Strength"].default_value = 3.0
    box.data.materials.append(glow)
    box.visible_camera = False
    picture = {"width": 16, "height": 12, "samples": 128}
    shut = render("LUCH", **picture)[..., :3].mean()
    box.visible_shadow = False
    ours, theirs = (render(engine, **picture)[..., :3].mean() for engine in ("LUCH", "CYCLES"))
    assert ours == pytest.approx(theirs, rel=0.1)
    assert ours > 1.3 * shut

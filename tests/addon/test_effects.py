"""Effects of scenes as Blender makes them: what a user sets is what the list tells."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from luch.effects import Effects, effects_of
from support.objects import point_cloud

from addon import engine


@pytest.fixture
def room(scene: bpy.types.Scene) -> bpy.types.Scene:
    """A cube of the material "Leaves" before a camera."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Leaves"))
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    return scene


def exported(scene: bpy.types.Scene) -> Effects:
    return effects_of(engine.capture_scene(scene, scene.view_layers[0]))


def on(effects: Effects) -> set[str]:
    """What is on beside what every surface brings along."""
    plain = {"diffuse bounces", "glossy bounces", "indirect light", "reflective caustics", "pass Combined"}
    return set(effects.names(on=True)) - plain


def surface(scene: bpy.types.Scene) -> Any:
    return bpy.data.materials["Leaves"].node_tree.nodes["Principled BSDF"]


@pytest.mark.parametrize(
    ("inputs", "effects"),
    [
        ({}, set()),
        ({"Alpha": 0.5}, {"transparency", "transparent shadows", "transparent bounces"}),
        ({"Transmission Weight": 1.0}, {"transmission", "transmission bounces"}),
        ({"Coat Weight": 0.5}, {"coat"}),
        ({"Sheen Weight": 0.5}, {"sheen"}),
        ({"Anisotropic": 0.5}, {"anisotropy"}),
        ({"Thin Film Thickness": 400.0}, {"thin film"}),
        ({"Emission Strength": 2.0}, {"emissive meshes", "light tree"}),
        ({"Emission Strength": 2.0, "Coat Weight": 1.0}, {"emissive meshes", "light tree", "coat"}),
    ],
    ids=lambda value: "+".join(value) if isinstance(value, dict) else "",
)
def test_what_principled_is_set_to_is_what_is_on(
    room: bpy.types.Scene, inputs: dict[str, float], effects: set[str]
) -> None:
    for name, value in inputs.items():
        surface(room).inputs[name].default_value = value
    found = exported(room)
    assert on(found) == effects
    assert all('"Leaves"' in found[name].reason for name in effects - {"light tree", "transmission bounces"})


def test_a_texture_behind_a_coat_of_weight_0_is_not_read(room: bpy.types.Scene) -> None:
    tree = bpy.data.materials["Leaves"].node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Fac"], surface(room).inputs["Coat Roughness"])
    assert not exported(room)["noise"].on
    surface(room).inputs["Coat Weight"].default_value = 0.5
    assert exported(room)["noise"].reason == 'material "Leaves" reads it'
    bump = tree.nodes.new("ShaderNodeBump")
    tree.links.new(noise.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], surface(room).inputs["Normal"])
    assert exported(room)["bump"].on
    bump.inputs["Strength"].default_value = 0.0
    assert not exported(room)["bump"].on


def test_an_f_stop_without_depth_of_field_is_told(room: bpy.types.Scene) -> None:
    lens = room.camera.data.dof
    lens.aperture_fstop = 1.4
    reason = exported(room)["depth of field"].reason
    assert reason == "the f-stop is set (f/1.4) but the camera's Depth of Field is disabled"
    lens.use_dof = True
    assert exported(room)["depth of field"].on


def uneven_volume(scene: bpy.types.Scene) -> None:
    tree = bpy.data.materials["Leaves"].node_tree
    fog, noise = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], fog.inputs["Density"])
    tree.links.new(fog.outputs[0], tree.nodes["Material Output"].inputs["Volume"])


def displaced(scene: bpy.types.Scene) -> None:
    material = bpy.data.materials["Leaves"]
    material.displacement_method = "DISPLACEMENT"
    tree = material.node_tree
    lift = tree.nodes.new("ShaderNodeDisplacement")
    tree.links.new(lift.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])


@pytest.mark.parametrize(
    ("effect", "ask", "who"),
    [
        ("heterogeneous volumes", uneven_volume, "Leaves"),
    ],
)
def test_what_is_asked_for_in_vain_is_named(
    room: bpy.types.Scene, effect: str, ask: Callable[[bpy.types.Scene], None], who: str
) -> None:
    assert exported(room)[effect].state == "off"
    ask(room)
    found = exported(room)[effect]
    assert found.state == "not yet"
    assert who in found.reason


def test_a_surface_that_its_material_moves_is_told(room: bpy.types.Scene) -> None:
    assert exported(room)["displacement"].state == "off"
    displaced(room)
    found = exported(room)["displacement"]
    assert found.on and "moved by their materials" in found.reason


@pytest.mark.parametrize(("method", "words"), [("RANDOM_WALK", ""), ("RANDOM_WALK_SKIN", ", by Random Walk (Skin)")])
def test_subsurface_follows_its_weight_and_its_scale(room: bpy.types.Scene, method: str, words: str) -> None:
    node = surface(room)
    node.subsurface_method = method
    assert exported(room)["subsurface"].state == "off"
    node.inputs["Subsurface Weight"].default_value = 0.5
    assert exported(room)["subsurface"].reason == f'material "Leaves" has subsurface weight 0.5{words}'
    node.inputs["Subsurface Scale"].default_value = 0.0
    assert exported(room)["subsurface"].state == "off"


def test_point_clouds_are_told(room: bpy.types.Scene) -> None:
    assert not exported(room)["point clouds"].on
    point_cloud("Dust", [(0, 0, 0), (0, 0, 1), (0, 0, 2)])
    found = exported(room)["point clouds"]
    assert found.on
    assert found.reason == '"Dust": 3 spheres'


def test_world_and_lamps_are_told_as_they_are_built(room: bpy.types.Scene) -> None:
    room.world = bpy.data.worlds.new("Day")
    bpy.ops.object.light_add(type="SPOT")
    bpy.context.object.data.shadow_soft_size = 0.25
    assert {"world colour", "spot lamps", "soft shadows of lamps", "visible lamps"} <= on(exported(room))
    tree = room.world.node_tree
    picture = bpy.data.images.new("Field", 8, 4, float_buffer=True)
    picture.pixels.foreach_set(np.linspace(0.0, 1.0, 128, dtype=np.float32))
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = picture
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    found = exported(room)
    assert found["environment image"].reason == 'world "Day" shows an image'
    assert not found["world colour"].on
    sky = tree.nodes.new("ShaderNodeTexSky")
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    found = exported(room)
    assert found["sky"].on and not found["environment image"].on


def test_an_effect_is_left_out_at_a_press_and_taken_in_again(room: bpy.types.Scene) -> None:
    surface(room).inputs["Coat Weight"].default_value = 0.5
    for name in ("coat", "sheen"):
        assert bpy.ops.luch.leave_out_effect(effect=name) == {"FINISHED"}
    assert room.luch.without_effects == "coat; sheen"
    assert exported(room)["coat"].state == "left out"
    bpy.ops.luch.leave_out_effect(effect="coat")
    assert room.luch.without_effects == "sheen"
    assert exported(room)["coat"].on
    with pytest.raises(RuntimeError, match='"fog" cannot be left out'):
        bpy.ops.luch.leave_out_effect(effect="fog")


def test_absent_effects_are_simulated_on_request(room: bpy.types.Scene) -> None:
    assert not exported(room)["depth of field"].on
    room.luch.force_effects = True
    assert exported(room)["depth of field"].on

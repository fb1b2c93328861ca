"""Volumes of materials and of the world: Luch's picture against Cycles' of the same file."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from luch.scene import Scene
from numpy.typing import NDArray

Render = Callable[..., NDArray[np.float32]]
RenderPasses = Callable[..., dict[str, NDArray[np.float32]]]
ABSORPTION, SCATTER = "ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter"
PRINCIPLED, COEFFICIENTS = "ShaderNodeVolumePrincipled", "ShaderNodeVolumeCoefficients"
BLUE = (0.2, 0.5, 0.8, 1.0)
GREY = (0.8, 0.8, 0.8, 1.0)


def add_node(tree: bpy.types.NodeTree, kind: str, phase: str = "", **inputs: Any) -> bpy.types.Node:
    node: Any = tree.nodes.new(kind)
    if phase:
        node.phase = phase
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node  # type: ignore[no-any-return]


def volume(kind: str, surface: str = "", **inputs: Any) -> bpy.types.Material:
    """A material with one node at its Volume socket, and a node as it comes at its Surface."""
    material = bpy.data.materials.new("Volume")
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(add_node(tree, kind, **inputs).outputs[0], output.inputs["Volume"])
    if surface:
        tree.links.new(tree.nodes.new(surface).outputs[0], output.inputs["Surface"])
    return material


def set_world(scene: bpy.types.Scene, light: float, kind: str = "", **inputs: Any) -> None:
    scene.world = bpy.data.worlds.new("World")
    tree = scene.world.node_tree
    tree.nodes["Background"].inputs["Color"].default_value = (light, 0.8 * light, 0.6 * light, 1.0)
    if kind:
        tree.links.new(add_node(tree, kind, **inputs).outputs[0], tree.nodes["World Output"].inputs["Volume"])


def stage(scene: bpy.types.Scene, light: float = 0.0) -> None:
    """A matt floor, a lamp above it, a camera aslant."""
    set_world(scene, light)
    matt = bpy.data.materials.new("Matt")
    matt.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.context.object.data.materials.append(matt)
    bpy.ops.object.camera_add(location=(0.0, -5.0, 2.5), rotation=(1.15, 0.0, 0.0))
    scene.camera = bpy.context.object
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.data.shadow_soft_size, lamp.location = 200.0, 0.2, (1.5, -0.5, 2.5)
    scene.collection.objects.link(lamp)
    scene.cycles.max_bounces, scene.cycles.volume_bounces = 4, 0


def cube(material: bpy.types.Material, size: float = 1.6, place: Any = (0, 0, 1), turn: Any = (0, 0, 0.4)) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=size, location=place, rotation=turn)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def assert_alike(render: Render, samples: int = 256, mean: float = 0.01, tile: float = 0.06) -> None:
    """Means of the picture by channel within `mean`; 4x4 tiles within `tile` of the brightest one."""
    ours, theirs = (render(engine, width=24, height=16, samples=samples).astype(float) for engine in ("LUCH", "CYCLES"))
    assert np.isfinite(ours).all()
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=mean, atol=1e-5)
    tiles = [picture[..., :3].reshape(4, 4, 6, 4, 3).mean((1, 3)) for picture in (ours, theirs)]
    assert np.abs(tiles[0] - tiles[1]).max() <= tile * tiles[1].max()


CUBES: dict[str, dict[str, Any]] = {
    "absorbing": {"kind": ABSORPTION, "Color": BLUE, "Density": 2.0},
    "scattering": {"kind": SCATTER, "Color": BLUE, "Density": 1.0},
    "scattering forwards": {"kind": SCATTER, "Color": GREY, "Density": 1.5, "Anisotropy": 0.7},
    "scattering backwards": {"kind": SCATTER, "Color": GREY, "Density": 1.5, "Anisotropy": -0.7},
    "Rayleigh": {"kind": SCATTER, "phase": "RAYLEIGH", "Color": BLUE, "Density": 1.0},
    "Draine": {"kind": SCATTER, "phase": "DRAINE", "Color": GREY, "Anisotropy": 0.6, "Alpha": 2.0},
    "Fournier-Forand": {"kind": SCATTER, "phase": "FOURNIER_FORAND", "Color": GREY, "IOR": 1.2, "Backscatter": 0.1},
    "tiny drops": {"kind": SCATTER, "phase": "MIE", "Color": GREY, "Diameter": 0.05},
    "small drops": {"kind": SCATTER, "phase": "MIE", "Color": GREY, "Diameter": 1.0},
    "drops": {"kind": SCATTER, "phase": "MIE", "Color": GREY, "Diameter": 3.0},
    "large drops": {"kind": SCATTER, "phase": "MIE", "Color": GREY, "Diameter": 15.0},
    "principled": {"kind": PRINCIPLED, "Color": BLUE, "Density": 1.0, "Anisotropy": 0.3,
                   "Absorption_Color": (0.25, 0.04, 0.0, 1.0), "Emission_Strength": 0.3,
                   "Emission_Color": (1.0, 0.5, 0.2, 1.0)},
    "hot": {"kind": PRINCIPLED, "Color": (0.0, 0.0, 0.0, 1.0), "Density": 1.0, "Blackbody_Intensity": 0.7,
            "Blackbody_Tint": (1.0, 0.8, 0.6, 1.0), "Temperature": 2000.0},
    "coefficients": {"kind": COEFFICIENTS, "Absorption_Coefficients": (1.0, 0.5, 0.0),
                     "Scatter_Coefficients": (0.0, 0.5, 1.0), "Emission_Coefficients": (0.0, 0.1, 0.2)},
    "glowing": {"kind": "ShaderNodeEmission", "Color": (1.0, 0.6, 0.2, 1.0), "Strength": 0.4},
}  # fmt: skip


@pytest.mark.parametrize("name", CUBES)
def test_a_cube_looks_as_in_cycles(scene: bpy.types.Scene, render: Render, name: str) -> None:
    stage(scene, light=0.2)
    cube(volume(**CUBES[name]))
    # Drops throw light forwards: some paths hit the lamp, and are bright.
    assert_alike(render, mean=0.03 if "drops" in name else 0.01, tile=0.15 if "drops" in name else 0.06)


@pytest.mark.parametrize("kind", [ABSORPTION, SCATTER])
def test_glass_holds_a_volume_as_in_cycles(scene: bpy.types.Scene, render: Render, kind: str) -> None:
    stage(scene, light=0.5)
    scene.objects["Lamp"].hide_render = True  # its caustic is noise
    cube(volume(kind, surface="ShaderNodeBsdfGlass", Color=BLUE, Density=2.0))
    scene.cycles.max_bounces = scene.cycles.volume_bounces = 12
    assert_alike(render, tile=0.1)


@pytest.mark.parametrize("bounces", [0, 1, 8])
def test_volume_bounces_are_counted_as_in_cycles(scene: bpy.types.Scene, render: Render, bounces: int) -> None:
    stage(scene, light=0.3)
    cube(volume(SCATTER, Color=GREY, Density=3.0, Anisotropy=0.3))
    scene.cycles.max_bounces, scene.cycles.volume_bounces = 12, bounces
    assert_alike(render)


@pytest.mark.parametrize("bounces", [0, 1])
def test_max_bounces_end_paths_in_volumes_as_in_cycles(scene: bpy.types.Scene, render: Render, bounces: int) -> None:
    stage(scene, light=0.3)
    cube(volume(SCATTER, Color=GREY, Density=1.0))
    scene.cycles.max_bounces, scene.cycles.volume_bounces = bounces, 4
    assert_alike(render)


def test_nested_and_overlapping_volumes_add_up_as_in_cycles(scene: bpy.types.Scene, render: Render) -> None:
    stage(scene)
    cube(volume(SCATTER, Color=(0.8, 0.3, 0.3, 1.0), Density=1.0))
    cube(volume(ABSORPTION, Color=(0.3, 0.8, 0.3, 1.0), Density=2.0), 0.8, turn=(0.2, 0.3, 0.1))
    cube(volume(SCATTER, Color=(0.2, 0.2, 0.9, 1.0), Density=2.0), 0.9, place=(0.7, 0.1, 1.2))
    assert_alike(render)


@pytest.mark.parametrize("kind", [ABSORPTION, SCATTER])
def test_fog_in_the_world_is_that_of_cycles(scene: bpy.types.Scene, render: Render, kind: str) -> None:
    stage(scene)
    set_world(scene, 0.5, kind, Color=(0.9, 0.8, 0.5, 1.0), Density=0.1)
    assert_alike(render, samples=512, mean=0.015)


def test_fog_in_the_world_hides_a_sun_as_in_cycles(scene: bpy.types.Scene, render: Render) -> None:
    stage(scene)
    scene.objects["Lamp"].hide_render = True
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)
    set_world(scene, 0.5, SCATTER, Color=GREY, Density=0.1)
    for engine in ("LUCH", "CYCLES"):
        assert render(engine, width=8, height=8, samples=4)[..., :3].max() == 0.0


@pytest.mark.parametrize("lens", ["PERSP", "ORTHO"])
def test_a_camera_within_a_volume_sees_as_in_cycles(scene: bpy.types.Scene, render: Render, lens: str) -> None:
    stage(scene)
    scene.camera.data.type, scene.camera.data.ortho_scale = lens, 5.0
    scene.cycles.volume_bounces = 2
    if lens == "PERSP":
        cube(volume(SCATTER, Color=GREY, Density=0.1), 14.0)
    else:  # half of the picture begins inside
        cube(volume(SCATTER, Color=GREY, Density=0.3), 3.0, place=(1.0, -5.0, 2.5))
    assert_alike(render, samples=512, mean=0.015)


def test_mix_and_add_blend_volumes_as_in_cycles(scene: bpy.types.Scene, render: Render) -> None:
    stage(scene, light=0.2)
    material = volume(SCATTER, Color=GREY, Density=2.0)
    tree = material.node_tree
    mix, both = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeAddShader")
    mix.inputs["Fac"].default_value = 0.3
    scatter, output = tree.nodes["Volume Scatter"], tree.nodes["Material Output"]
    tree.links.new(scatter.outputs[0], mix.inputs[1])
    tree.links.new(add_node(tree, PRINCIPLED, Color=BLUE, Emission_Strength=0.5).outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], both.inputs[0])
    tree.links.new(add_node(tree, ABSORPTION, Color=BLUE, Density=0.5).outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], output.inputs["Volume"])
    cube(material)
    assert_alike(render)


def test_volume_passes_and_alpha_are_those_of_cycles(scene: bpy.types.Scene, render_passes: RenderPasses) -> None:
    stage(scene, light=0.3)
    bpy.data.objects["Plane"].hide_render = True
    cube(volume(SCATTER, Color=BLUE, Density=1.0))
    scene.cycles.volume_bounces = 4
    scene.render.film_transparent = True
    layer = scene.view_layers[0]
    layer.cycles.use_pass_volume_direct = layer.cycles.use_pass_volume_indirect = True
    ours, theirs = (render_passes(engine, width=16, height=12, samples=256) for engine in ("LUCH", "CYCLES"))
    for name in ("Combined", "Volume Direct", "Volume Indirect"):
        means = [passes[name].astype(float).mean((0, 1)) for passes in (ours, theirs)]
        np.testing.assert_allclose(means[0], means[1], rtol=0.02, err_msg=name)


def exported() -> Scene:
    from addon.export import export_scene

    return export_scene(bpy.context.evaluated_depsgraph_get())


def test_a_volume_that_changes_from_place_to_place_is_named_and_left_out(scene: bpy.types.Scene) -> None:
    stage(scene)
    material = volume(SCATTER, Density=1.0)
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], tree.nodes["Volume Scatter"].inputs["Density"])
    cube(material)
    result = exported()
    assert all(m.volume is None for m in result.materials)
    (told,) = result.unsupported["heterogeneous volumes"]
    assert 'Material "Volume": node "Volume Scatter" changes from place to place' in told


@pytest.mark.parametrize(
    ("switch", "name"),
    [
        ("use_pass_volume_majorant", "Volume Majorant"),
        ("use_pass_shadow_catcher", "Shadow Catcher"),
        ("denoising_store_passes", "Denoising Depth"),
    ],
)
def test_passes_of_cycles_that_are_not_rendered_are_named(scene: bpy.types.Scene, switch: str, name: str) -> None:
    stage(scene)
    setattr(scene.view_layers[0].cycles, switch, True)
    assert any(f'the pass "{name}"' in warning for warning in exported().warnings)


def test_numbers_that_nodes_compute_make_an_even_volume(scene: bpy.types.Scene) -> None:
    stage(scene)
    material = volume(ABSORPTION, Color=(0.0, 0.0, 0.0, 1.0))
    tree = material.node_tree
    product = add_node(tree, "ShaderNodeMath")
    product.operation = "MULTIPLY"  # type: ignore[attr-defined]
    product.inputs[0].default_value, product.inputs[1].default_value = 2.0, 1.5  # type: ignore[attr-defined]
    tree.links.new(product.outputs[0], tree.nodes["Volume Absorption"].inputs["Density"])
    cube(material)
    (medium,) = [m.volume for m in exported().materials if m.volume is not None]
    assert medium.absorption == pytest.approx((3.0, 3.0, 3.0))
    assert math.isclose(sum(medium.emission), 0.0)

"""Hair curves and particle hair: what is exported, and how they look beside Cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from support.objects import Render, assert_same_picture, look_down, show
from support.pictures import F32, assert_pictures_agree

from addon.export import export_scene

SHAPES = ("RIBBONS", "THICK", "THICK_LINEAR")
# Bent strands of different widths; x, y, z, radius.
STRANDS = (
    ((-2.0, -1.5, 0.0, 0.3), (-1.0, -0.4, 0.6, 0.25), (0.5, -1.2, 1.2, 0.2), (2.0, -0.8, 0.8, 0.1)),
    ((-1.8, 1.6, 0.0, 0.15), (-0.5, 0.4, 0.9, 0.2), (1.9, 1.0, 0.4, 0.3)),
    ((0.0, 2.2, 0.3, 0.2), (1.5, 1.8, 0.5, 0.0)),
)
Build = Callable[[bpy.types.Material], bpy.types.Node]


def hair(material: bpy.types.Material | None, strands: Any = STRANDS) -> bpy.types.Object:
    """Curves of the scene with attributes of each domain, stretched and turned."""
    data = bpy.data.hair_curves.new("Fur")
    data.add_curves([len(strand) for strand in strands])
    rows = np.concatenate([np.array(strand, np.float32) for strand in strands])
    data.attributes["position"].data.foreach_set("vector", rows[:, :3].ravel())
    layer = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    layer.data.foreach_set("value", np.ascontiguousarray(rows[:, 3]))
    age = data.attributes.new("age", "FLOAT", "POINT")
    age.data.foreach_set("value", np.linspace(0.0, 2.0, len(rows), dtype=np.float32))
    tint = data.attributes.new("tint", "FLOAT_COLOR", "CURVE")
    tint.data.foreach_set("color", np.linspace(0.1, 0.9, 4 * len(strands), dtype=np.float32))
    place = data.attributes.new("surface_uv_coordinate", "FLOAT2", "CURVE")
    place.data.foreach_set("vector", np.linspace(0.2, 0.8, 2 * len(strands), dtype=np.float32))
    if material is not None:
        data.materials.append(material)
    subject = bpy.data.objects.new("Fur", data)
    bpy.context.scene.collection.objects.link(subject)
    subject.location, subject.rotation_euler, subject.scale = (0.2, 0.0, 0.5), (0.1, 0.2, 0.1), (1.1, 1.1, 1.1)
    return subject


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("node", "output", "settings"),
    [
        *(("ShaderNodeHairInfo", name, {}) for name in ("Intercept", "Thickness", "Tangent Normal", "Random")),
        *(("ShaderNodeNewGeometry", name, {}) for name in ("Normal", "True Normal", "Position")),
    ],
)
def test_a_curve_tells_its_shader_the_same_in_every_shape(
    scene: bpy.types.Scene, render: Render, shape: str, node: str, output: str, settings: dict[str, str]
) -> None:
    told(scene, render, node, output, settings, shape)


@pytest.mark.parametrize(
    ("node", "output", "settings"),
    [
        *(("ShaderNodeHairInfo", name, {}) for name in ("Is Strand", "Length")),
        *(("ShaderNodeTexCoord", name, {}) for name in ("UV", "Object")),
        *(("ShaderNodeAttribute", "Color", {"attribute_name": name}) for name in ("age", "tint", "position", "radius")),
        ("ShaderNodeUVMap", "UV", {}),
    ],
)
def test_a_curve_tells_its_shader_the_same(
    scene: bpy.types.Scene, render: Render, node: str, output: str, settings: dict[str, str]
) -> None:
    told(scene, render, node, output, settings, "RIBBONS")


def told(scene: Any, render: Render, node: str, output: str, settings: dict[str, str], shape: str) -> None:
    material = show(node, output)
    source = next(found for found in material.node_tree.nodes if found.bl_idname == node)
    for name, value in settings.items():
        setattr(source, name, value)
    # Of a ribbon's default of 4 straight pieces Cycles makes 5 where it traces by Embree: many are the same.
    scene.cycles_curves.shape, scene.cycles_curves.subdivisions = shape, 4
    # A ground that glows: a curve that tells 0 must hide it.
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -3.0))
    bpy.context.object.data.materials.append(show("ShaderNodeTexCoord", "Object"))
    hair(material)
    look_down(scene, 6.0)
    assert_same_picture(render, edge_share=0.08)


def shaded(node: str, **inputs: Any) -> bpy.types.Material:
    """A material of one closure; inputs by socket, properties in capitals' lower case (model, component...)."""
    material = bpy.data.materials.new("Hair")
    tree = material.node_tree
    tree.nodes.clear()
    made = tree.nodes.new(node)
    for name, value in inputs.items():
        if name in made.inputs:
            made.inputs[name].default_value = value
        else:
            setattr(made, name, value)
    tree.links.new(made.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


MATERIALS: dict[str, Callable[[], bpy.types.Material]] = {
    "blond": lambda: shaded("ShaderNodeBsdfHairPrincipled", parametrization="MELANIN", Melanin=0.3),
    "dark, sharp": lambda: shaded(
        "ShaderNodeBsdfHairPrincipled", parametrization="MELANIN", Melanin=0.9, Roughness=0.15, Coat=0.5
    ),
    "absorbing, rough": lambda: shaded(
        "ShaderNodeBsdfHairPrincipled", parametrization="ABSORPTION", Roughness=0.7, **{"Radial Roughness": 0.6}
    ),
    "coloured": lambda: shaded("ShaderNodeBsdfHairPrincipled", Color=(0.6, 0.3, 0.1, 1.0), **{"Random Roughness": 0.5}),
    "reflection": lambda: shaded("ShaderNodeBsdfHair", Offset=0.2, RoughnessU=0.3, RoughnessV=0.4),
    "transmission": lambda: shaded("ShaderNodeBsdfHair", component="Transmission", RoughnessU=0.3, RoughnessV=0.5),
    "diffuse": lambda: shaded("ShaderNodeBsdfDiffuse"),
}


def light_it(scene: bpy.types.Scene) -> None:
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 2.0, 0.3
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.4, 0.5, 1.0)
    scene.cycles.max_bounces = scene.cycles.transmission_bounces = scene.cycles.glossy_bounces = 8


@pytest.mark.parametrize("shape", ["RIBBONS", "THICK"])
@pytest.mark.parametrize("name", MATERIALS)
def test_hair_is_shaded_the_same(scene: bpy.types.Scene, render: Render, name: str, shape: str) -> None:
    scene.cycles_curves.shape = shape
    hair(MATERIALS[name]())
    light_it(scene)
    look_down(scene, 5.0)
    ours, theirs = (
        [render(engine, width=32, height=32, samples=64, seed=seed) for seed in (1, 2)] for engine in ("LUCH", "CYCLES")
    )
    measure = without_noise(ours, theirs)
    assert_pictures_agree(f"hair {name} {shape}", ours[0], theirs[0], tolerance=2e-3, measure=measure)
    # Where Cycles' sampling and evaluation do not fit each other its light depends on which of the two finds it:
    # directions behind a ribbon (the plane across the ray) of a diffuse lobe, those beyond the node's reflection. A sun,
    # which is only evaluated, agrees to 2e-4.
    share = 0.025 if name == "reflection" or (name, shape) == ("diffuse", "RIBBONS") else 0.01
    for channel in range(3):
        mean, expected = (np.mean([p[..., channel] for p in pictures]) for pictures in (ours, theirs))
        assert mean == pytest.approx(expected, rel=share)


def without_noise(ours: list[F32], theirs: list[F32]) -> float:
    """relMSE of two engines from two renders of each: independent noise has no part in the product."""
    (a, b), (c, d) = ((np.asarray(x[..., :3], np.float64) for x in pictures) for pictures in (ours, theirs))
    return float(np.mean((a - c) * (b - d) / (0.5 * (c + d) + 0.01) ** 2))


def particles(children: bool, **settings: Any) -> bpy.types.Object:
    bpy.ops.mesh.primitive_plane_add(size=3.0)
    emitter = bpy.context.object
    emitter.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair_settings = emitter.particle_systems[0].settings
    hair_settings.type, hair_settings.count, hair_settings.hair_length = "HAIR", 12, 1.5
    hair_settings.radius_scale, hair_settings.brownian_factor = 0.2, 0.3
    if children:
        hair_settings.child_type, hair_settings.rendered_child_count, hair_settings.child_percent = "SIMPLE", 6, 6
    for name, value in settings.items():
        setattr(hair_settings, name, value)
    return emitter


@pytest.mark.parametrize(
    ("children", "settings"),
    [
        (False, {}),
        (False, {"shape": 0.6, "use_close_tip": False, "tip_radius": 0.4, "render_step": 2}),
        (True, {"root_radius": 0.5}),
    ],
)
@pytest.mark.parametrize("output", ["Normal", "Position"])
def test_particle_hair_is_the_same(
    scene: bpy.types.Scene, render: Render, children: bool, settings: dict[str, Any], output: str
) -> None:
    emitter = particles(children, **settings)
    emitter.data.materials.append(show("ShaderNodeNewGeometry", output))
    emitter.location, emitter.rotation_euler = (0.2, 0.1, 0.0), (0.9, 0.1, 0.0)
    look_down(scene, 5.0)
    assert_same_picture(render, edge_share=0.1)


def test_particle_hair_tells_where_it_grows(scene: bpy.types.Scene, render: Render) -> None:
    emitter = particles(False)
    emitter.data.materials.append(show("ShaderNodeTexCoord", "UV"))
    look_down(scene, 4.0)
    assert_same_picture(render, edge_share=0.1)


def test_points_that_are_not_finite_are_told_by_name(scene: bpy.types.Scene) -> None:
    subject = hair(None)
    subject.data.attributes["radius"].data[1].value = np.nan
    bpy.ops.object.camera_add()
    scene.camera = bpy.context.object
    exported = export_scene(bpy.context.evaluated_depsgraph_get())
    (warning,) = exported.warnings
    assert warning.startswith('Curves "Fur": point 1 is not finite')
    assert exported.meshes[0].curves is not None and np.isfinite(exported.meshes[0].curves.points).all()


def test_the_model_that_is_missing_is_told_by_name(scene: bpy.types.Scene) -> None:
    hair(shaded("ShaderNodeBsdfHairPrincipled", model="HUANG"))
    bpy.ops.object.camera_add()
    scene.camera = bpy.context.object
    exported = export_scene(bpy.context.evaluated_depsgraph_get())
    assert "Huang hair" in exported.unsupported

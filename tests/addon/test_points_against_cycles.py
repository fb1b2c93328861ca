"""Point clouds: what is exported, and how they look beside Cycles."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from luch.scene import Scene
from support.objects import Render, assert_same_picture, look_down, point_cloud, show
from support.pictures import F32, assert_pictures_agree

from addon.export import export_scene

LAYERS = {
    "tint": ("FLOAT_COLOR", "color", [0.3, 0.5, 0.7, 0.5, 1.0, 2.0, 3.0, 0.25]),
    "wind": ("FLOAT_VECTOR", "vector", [0.2, 0.4, 0.6, 1.0, 0.5, 0.25]),
    "map": ("FLOAT2", "vector", [0.15, 0.35, 0.5, 0.7]),
    "age": ("FLOAT", "value", [0.5, 2.0]),
    "seen": ("BOOLEAN", "value", [True, False]),
    "count": ("INT", "value", [3, 5]),
}


def pair() -> bpy.types.Object:
    """Two points with attributes of every kind, stretched and turned."""
    subject = point_cloud("Dust", [(-1.0, 0.0, 0.0), (1.0, 0.5, 0.0)], [1.5, 0.5])
    for name, (kind, value, numbers) in LAYERS.items():
        subject.data.attributes.new(name, kind, "POINT").data.foreach_set(value, np.array(numbers))
    subject.location, subject.scale = (0.25, 0.0, 1.0), (1.2, 1.0, 0.8)
    subject.rotation_euler = (0.3, 0.2, 0.1)
    return subject


@pytest.mark.parametrize(
    ("node", "output", "settings"),
    [
        *(("ShaderNodePointInfo", name, {}) for name in ("Position", "Radius", "Random")),
        *(("ShaderNodeTexCoord", name, {}) for name in ("Generated", "UV", "Object", "Normal", "Reflection")),
        *(("ShaderNodeNewGeometry", name, {}) for name in ("Normal", "True Normal", "Tangent", "Parametric")),
        *(("ShaderNodeNewGeometry", name, {}) for name in ("Backfacing", "Pointiness", "Random Per Island")),
        *(("ShaderNodeAttribute", "Color", {"attribute_name": name}) for name in (*LAYERS, "position", "radius")),
        ("ShaderNodeAttribute", "Alpha", {"attribute_name": "tint"}),
        ("ShaderNodeVertexColor", "Color", {"layer_name": "tint"}),
        ("ShaderNodeVertexColor", "Color", {}),
        ("ShaderNodeUVMap", "UV", {"uv_map": "map"}),
        ("ShaderNodeTangent", "Tangent", {"direction_type": "RADIAL", "axis": "X"}),
        ("ShaderNodeWireframe", "Factor", {}),
        ("ShaderNodeObjectInfo", "Random", {}),
    ],
)
def test_a_point_tells_its_shader_the_same(
    scene: bpy.types.Scene, render: Render, node: str, output: str, settings: dict[str, str]
) -> None:
    material = show(node, output)
    source = next(found for found in material.node_tree.nodes if found.bl_idname == node)
    for name, value in settings.items():
        setattr(source, name, value)
    # A ground that glows: a point that tells 0 must hide it.
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -3.0))
    bpy.context.object.data.materials.append(show("ShaderNodeTexCoord", "Object"))
    pair().data.materials.append(material)
    look_down(scene, 6.0)
    assert_same_picture(render, edge_share=0.02)


def scatter_points(radius: float, material: bpy.types.Material | None, *, instances: bool, mesh: bool) -> None:
    """A cube whose corners geometry nodes turn into points; on three places; beside the cube itself."""
    group = bpy.data.node_groups.new("Dots", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    given, result = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    dots, setter = nodes.new("GeometryNodeMeshToPoints"), nodes.new("GeometryNodeSetMaterial")
    dots.inputs["Radius"].default_value = radius
    setter.inputs["Material"].default_value = material
    links.new(given.outputs[0], dots.inputs["Mesh"])
    links.new(dots.outputs["Points"], setter.inputs["Geometry"])
    made = setter.outputs[0]
    if instances:
        line, place = nodes.new("GeometryNodeMeshLine"), nodes.new("GeometryNodeInstanceOnPoints")
        line.inputs["Count"].default_value = 3
        line.inputs["Offset"].default_value = (2.5, 0.5, 0.25)
        place.inputs["Scale"].default_value = (1.0, 0.5, 1.5)
        links.new(line.outputs[0], place.inputs["Points"])
        links.new(made, place.inputs["Instance"])
        made = place.outputs[0]
    if mesh:
        join = nodes.new("GeometryNodeJoinGeometry")
        links.new(made, join.inputs[0])
        links.new(given.outputs[0], join.inputs[0])
        made = join.outputs[0]
    links.new(made, result.inputs[0])
    bpy.ops.mesh.primitive_cube_add(size=1.5)
    bpy.context.object.data.materials.append(show("ShaderNodeNewGeometry", "Normal"))
    bpy.context.object.modifiers.new("Dots", "NODES").node_group = group


@pytest.mark.parametrize("instances", [False, True], ids=["once", "instanced"])
@pytest.mark.parametrize("output", ["Random", "Location"])
def test_points_of_geometry_nodes_are_the_same(
    scene: bpy.types.Scene, render: Render, instances: bool, output: str
) -> None:
    scatter_points(0.5, show("ShaderNodeObjectInfo", output), instances=instances, mesh=True)
    look_down(scene, 9.0 if instances else 4.0)
    assert_same_picture(render, edge_share=0.05)


def surface(kind: str) -> bpy.types.Material:
    material = bpy.data.materials.new(kind)
    tree = material.node_tree
    principled = tree.nodes["Principled BSDF"]
    if kind == "tinted":
        source = tree.nodes.new("ShaderNodeAttribute")
        source.attribute_name = "tint"
        tree.links.new(source.outputs["Color"], principled.inputs["Base Color"])
        principled.inputs["Specular IOR Level"].default_value = 0.0
    elif kind == "glass":
        principled.inputs["Transmission Weight"].default_value = 1.0
        principled.inputs["Roughness"].default_value = 0.2
    elif kind == "glowing":
        principled.inputs["Emission Color"].default_value = (1.0, 0.5, 0.2, 1.0)
        principled.inputs["Emission Strength"].default_value = 2.0
    elif kind == "half clear":
        principled.inputs["Alpha"].default_value = 0.5
    return material


def light_up(scene: bpy.types.Scene, lamp: bool = True) -> None:
    """A floor and an even world, perhaps a soft lamp; seen from above."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, location=(0.0, 0.0, -0.8))
    if lamp:
        bpy.ops.object.light_add(type="AREA", location=(2.0, -2.0, 5.0), rotation=(0.4, 0.4, 0.0))
        bpy.context.object.data.energy, bpy.context.object.data.size = 300.0, 2.0
    scene.world = bpy.data.worlds.new("Day")
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.3, 0.4, 0.5, 1.0)
    look_down(scene, 5.0)


def cloud_of(kind: str) -> None:
    rng = np.random.default_rng(5)
    subject = point_cloud("Dust", rng.uniform(-1.5, 1.5, (40, 3)) * [1.0, 1.0, 0.4], rng.uniform(0.1, 0.4, 40))
    colors = np.concatenate([rng.uniform(0.1, 0.9, (40, 3)), np.ones((40, 1))], axis=1).astype(np.float32)
    subject.data.attributes.new("tint", "FLOAT_COLOR", "POINT").data.foreach_set("color", colors.ravel())
    subject.data.materials.append(surface(kind))


def without_noise(ours: list[F32], theirs: list[F32]) -> float:
    """relMSE of two engines from two renders of each: independent noise has no part in the product."""
    (a, b), (c, d) = ((np.asarray(x[..., :3], np.float64) for x in pictures) for pictures in (ours, theirs))
    return float(np.mean((a - c) * (b - d) / (0.5 * (c + d) + 0.01) ** 2))


@pytest.mark.parametrize("kind", ["tinted", "glass", "glowing", "half clear"])
def test_lit_points_look_the_same(scene: bpy.types.Scene, render: Render, kind: str) -> None:
    light_up(scene, lamp=kind != "glass")  # whose caustics would be all noise; 2,048 samples agree to 4e-5
    cloud_of(kind)
    ours, theirs = (
        [render(engine, width=40, height=40, samples=32, seed=seed) for seed in (1, 2)] for engine in ("LUCH", "CYCLES")
    )
    # Measured: below 2e-4 in all of them, below 4e-5 with 512 samples or more.
    name = f"points {kind}"
    assert_pictures_agree(name, ours[0], theirs[0], tolerance=5e-4, measure=without_noise(ours, theirs))
    for channel in range(3):
        assert np.mean([p[..., channel] for p in ours]) == pytest.approx(
            np.mean([p[..., channel] for p in theirs]), rel=0.01
        )


def test_depth_normal_and_indices_are_those_of_cycles(
    scene: bpy.types.Scene, render_passes: Callable[..., dict[str, F32]]
) -> None:
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
    layer.use_pass_object_index = layer.use_pass_material_index = layer.use_pass_uv = True
    subject = pair()
    subject.pass_index = 7
    subject.data.materials.append(surface("glass"))
    subject.data.materials[0].pass_index = 5
    look_down(scene, 6.0)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    ours, theirs = (render_passes(engine, width=24, height=24, samples=1) for engine in ("LUCH", "CYCLES"))
    hit = theirs["Object Index"][..., 0] == 7
    assert hit.sum() > 100
    for name in ("Depth", "Normal", "Position", "UV", "Object Index", "Material Index"):
        a, b = (np.atleast_3d(passes[name])[hit] for passes in (ours, theirs))
        same = np.abs(a - b).max(axis=1) < 5e-3
        assert same.mean() > 0.97, name


def export() -> Scene:
    look_down(bpy.context.scene, 5.0)
    return export_scene(bpy.context.evaluated_depsgraph_get())


def test_points_without_a_radius_are_a_centimetre_wide(scene: bpy.types.Scene) -> None:
    point_cloud("Dust", [(0, 0, 0), (1, 2, 3)])
    (mesh,) = export().meshes
    assert mesh.spheres is not None
    assert np.array_equal(mesh.spheres, np.float32([[0, 0, 0, 0.01], [1, 2, 3, 0.01]]))


def test_points_that_cannot_be_drawn_are_named_and_keep_their_number(scene: bpy.types.Scene) -> None:
    point_cloud("Dust", [(0, 0, 0), (np.nan, 0, 0), (1, 0, 0), (2, 0, 0)], [1.0, 1.0, -1.0, np.inf])
    result = export()
    (mesh,) = result.meshes
    assert mesh.spheres is not None
    assert mesh.spheres[:, 3].tolist() == [1.0, 0.0, 0.0, 0.0], "Cycles draws no negative radius"
    (warning,) = result.warnings
    assert 'Point cloud "Dust": point 1 is not finite; 2 such points' in warning


def test_an_empty_point_cloud_draws_nothing(scene: bpy.types.Scene) -> None:
    scene.collection.objects.link(bpy.data.objects.new("Dust", bpy.data.pointclouds.new("Dust")))
    result = export()
    assert not result.meshes and not result.warnings and not result.unsupported


def test_instances_of_points_share_one_mesh(scene: bpy.types.Scene) -> None:
    scatter_points(0.2, None, instances=True, mesh=False)
    result = export()
    (mesh,) = result.meshes
    assert mesh.spheres is not None and len(mesh.spheres) == 8
    assert result.instances is not None and len(result.instances.object) == 3

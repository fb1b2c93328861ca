"""What objects, meshes and instancers tell shaders, beside Cycles: emission shows the value, without noise."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import pytest
from support.objects import Render, assert_same_picture, grid_of_instances, look_down, show


def add_object(kind: str) -> bpy.types.Object:
    if kind == "mesh":
        bpy.ops.mesh.primitive_monkey_add()
    elif kind == "text":
        bpy.ops.object.text_add(location=(-0.8, -0.3, 0.0))
        bpy.context.object.data.body = "MW"
    elif kind == "metaball":
        bpy.ops.object.metaball_add()
    else:
        bpy.ops.curve.primitive_bezier_circle_add()
        bpy.context.object.data.dimensions = "2D"
        bpy.context.object.data.fill_mode = "BOTH"
    return bpy.context.object


@pytest.mark.parametrize("kind", ["mesh", "text", "metaball", "curve"])
@pytest.mark.parametrize(
    ("node", "output"),
    [("ShaderNodeObjectInfo", "Random"), ("ShaderNodeObjectInfo", "Location"), ("ShaderNodeTexCoord", "Generated")],
)
def test_an_object_tells_its_shader_the_same(
    scene: bpy.types.Scene, render: Render, kind: str, node: str, output: str
) -> None:
    subject = add_object(kind)
    subject.location.z += 1.0
    subject.data.materials.append(show(node, output))
    look_down(scene, 2.5)
    assert_same_picture(render, edge_share=0.3 if kind == "text" else 0.15)


def instanced_by_collection(material: bpy.types.Material) -> None:
    collection = bpy.data.collections.new("Props")
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.materials.append(material)
    bpy.context.scene.collection.objects.unlink(cube)
    collection.objects.link(cube)
    for x in (-1.5, 1.5):
        empty = bpy.data.objects.new("Instancer", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location.x = x
        bpy.context.scene.collection.objects.link(empty)


def instanced_by_faces(material: bpy.types.Material) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=2, y_subdivisions=2, size=6.0)
    grid = bpy.context.object
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(material)
    bpy.context.object.parent = grid
    grid.instance_type = "FACES"
    grid.show_instancer_for_render = False


def instanced_by_geometry_nodes(material: bpy.types.Material) -> None:
    owner = grid_of_instances(2)
    group = owner.modifiers[0].node_group
    setter = group.nodes.new("GeometryNodeSetMaterial")
    setter.inputs["Material"].default_value = material
    cube = next(node for node in group.nodes if node.bl_idname == "GeometryNodeMeshCube")
    scatter = next(node for node in group.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    cube.inputs["Size"].default_value = (0.8, 0.8, 0.8)
    group.links.new(cube.outputs["Mesh"], setter.inputs["Geometry"])
    group.links.new(setter.outputs["Geometry"], scatter.inputs["Instance"])


@pytest.mark.parametrize("build", [instanced_by_collection, instanced_by_faces, instanced_by_geometry_nodes])
@pytest.mark.parametrize(
    ("node", "output"),
    [("ShaderNodeObjectInfo", "Random"), ("ShaderNodeObjectInfo", "Location"), ("ShaderNodeTexCoord", "Generated")],
)
def test_instances_tell_their_shaders_the_same(
    scene: bpy.types.Scene, render: Render, build: Callable[..., None], node: str, output: str
) -> None:
    build(show(node, output))
    look_down(scene, 8.0 if build is not instanced_by_geometry_nodes else 3.0)
    assert_same_picture(render)


@pytest.mark.parametrize("output", ["Generated", "UV"])
def test_the_instancers_coordinates_reach_its_instances(scene: bpy.types.Scene, render: Render, output: str) -> None:
    material = show("ShaderNodeTexCoord", output)
    next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeTexCoord").from_instancer = True
    instanced_by_faces(material)
    look_down(scene, 8.0)
    assert_same_picture(render)


@pytest.mark.parametrize("deform", ["BEND", "SHAPE_KEY", "SUBSURF", "NONE"])
def test_generated_coordinates_of_a_deformed_mesh_are_the_same(
    scene: bpy.types.Scene, render: Render, deform: str
) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8)
    grid = bpy.context.object
    grid.data.materials.append(show("ShaderNodeTexCoord", "Generated"))
    if deform == "BEND":
        bend = grid.modifiers.new("Bend", "SIMPLE_DEFORM")
        bend.deform_method, bend.angle, bend.deform_axis = "BEND", 1.0, "Z"
    elif deform == "SHAPE_KEY":
        grid.shape_key_add(name="Basis")
        key = grid.shape_key_add(name="Lean")
        for index in range(0, len(key.data), 2):
            key.data[index].co.x += 0.3
        key.value = 1.0
    elif deform == "SUBSURF":
        grid.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    look_down(scene, 3.0)
    assert_same_picture(render)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize(("node", "output"), [("ShaderNodeNewGeometry", "Normal"), ("ShaderNodeTexCoord", "UV")])
def test_an_object_scaled_to_nothing_is_drawn_flat(
    scene: bpy.types.Scene, render: Render, scale: tuple[float, float, float], node: str, output: str
) -> None:
    """Its matrix has no inverse. Scaled to a line it leaves nothing, and the floor shows."""
    bpy.ops.mesh.primitive_plane_add(size=9.0)
    bpy.context.object.data.materials.append(show("ShaderNodeTexCoord", "Generated"))
    upright = scale[1] == 0.0
    bpy.ops.mesh.primitive_grid_add(rotation=(1.5 if upright else 0.3, 0.2, 0.4), location=(0.2, 0.1, 1.0))
    grid = bpy.context.object
    grid.scale = scale
    if upright:
        for vertex in grid.data.vertices:
            vertex.co.yz = 0.0, vertex.co.y
    grid.data.materials.append(show(node, output))
    look_down(scene, 3.0)
    assert_same_picture(render, edge_share=0.02)


def test_an_attribute_of_the_view_layer_may_be_the_worlds(scene: bpy.types.Scene, render: Render) -> None:
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.7, 0.2, 0.4)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    material = show("ShaderNodeAttribute", "Color")
    source = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeAttribute")
    source.attribute_type, source.attribute_name = "VIEW_LAYER", "color"
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.data.materials.append(material)
    look_down(scene, 3.0)
    assert_same_picture(render)


@pytest.mark.parametrize("users", [1, 2])
@pytest.mark.parametrize("mirrored", [False, True])
def test_normals_of_an_unevenly_scaled_object_are_those_of_cycles(
    scene: bpy.types.Scene, render: Render, users: int, mirrored: bool
) -> None:
    """Blended in the world where the mesh is drawn once, in the object's space where it is shared."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=8, rotation=(1.2, 0.2, 0.4))
    bpy.ops.object.shade_smooth()
    cylinder = bpy.context.object
    cylinder.scale = (0.4, -1.0 if mirrored else 1.0, 1.4)
    cylinder.data.materials.append(show("ShaderNodeNewGeometry", "Normal"))
    if users == 2:
        twin = bpy.data.objects.new("Twin", cylinder.data)
        twin.location.x = 1.5
        twin.scale = (1.0, 0.3, 0.6)
        scene.collection.objects.link(twin)
    look_down(scene, 4.0)
    assert_same_picture(render, edge_share=0.03)

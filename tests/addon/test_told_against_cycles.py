"""What instancers tell each instance, beside Cycles: attributes of geometry nodes, values of particles."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from support.objects import Render, assert_same_picture, grid_of_instances, look_down, show


def show_attribute(kind: str, name: str, output: str = "Color") -> bpy.types.Material:
    material = show("ShaderNodeAttribute", output)
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = kind, name
    return material


def stored(group: Any, geometry: Any, name: str, data_type: str, socket_type: str) -> Any:
    """A random value on every instance."""
    store = group.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = data_type, "INSTANCE"
    store.inputs["Name"].default_value = name
    random = group.nodes.new("FunctionNodeRandomValue")
    random.data_type = socket_type
    source = next(socket for socket in random.outputs if socket.enabled)
    target = next(socket for socket in store.inputs if socket.enabled and socket.name == "Value")
    group.links.new(geometry, store.inputs["Geometry"])
    group.links.new(source, target)
    return store.outputs["Geometry"]


def instances_with_values(material: bpy.types.Material, nested: bool) -> bpy.types.Object:
    """Cubes on a grid; nested: three rows of such grids. "tint" is stored at the outer level, "value" at the inner."""
    owner = grid_of_instances(2)
    group = owner.modifiers[0].node_group
    nodes, links = group.nodes, group.links
    scatter = next(node for node in nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    cube = next(node for node in nodes if node.bl_idname == "GeometryNodeMeshCube")
    cube.inputs["Size"].default_value = (0.8, 0.8, 0.8)
    setter = nodes.new("GeometryNodeSetMaterial")
    setter.inputs["Material"].default_value = material
    links.new(cube.outputs["Mesh"], setter.inputs["Geometry"])
    links.new(setter.outputs["Geometry"], scatter.inputs["Instance"])
    geometry = stored(group, scatter.outputs["Instances"], "value", "FLOAT", "FLOAT")
    if nested:
        line = nodes.new("GeometryNodeMeshLine")
        line.inputs["Count"].default_value = 3
        line.inputs["Offset"].default_value = (2.0, 0.0, 0.0)
        again = nodes.new("GeometryNodeInstanceOnPoints")
        links.new(line.outputs["Mesh"], again.inputs["Points"])
        links.new(geometry, again.inputs["Instance"])
        geometry = again.outputs["Instances"]
    geometry = stored(group, geometry, "tint", "FLOAT_COLOR", "FLOAT_VECTOR")
    links.new(geometry, next(node for node in nodes if node.bl_idname == "NodeGroupOutput").inputs[0])
    return owner


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize(("name", "output"), [("tint", "Color"), ("value", "Fac")])
def test_instances_show_what_geometry_nodes_store_on_them(
    scene: bpy.types.Scene, render: Render, nested: bool, name: str, output: str
) -> None:
    owner = instances_with_values(show_attribute("INSTANCER", name, output), nested)
    owner.location.x = -2.0 if nested else 0.0
    look_down(scene, 8.0 if nested else 3.0)
    assert_same_picture(render, edge_share=0.3)


def test_what_is_not_stored_is_the_instancers_property(scene: bpy.types.Scene, render: Render) -> None:
    owner = instances_with_values(show_attribute("INSTANCER", "mine"), False)
    owner["mine"] = [0.2, 0.5, 0.7]
    look_down(scene, 3.0)
    assert_same_picture(render, edge_share=0.3)


def particles(material: bpy.types.Material) -> None:
    """Eight cubes that were born one after the other and fly apart."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, -50.0))
    cube = bpy.context.object
    cube.data.materials.append(material)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=2, y_subdivisions=2, size=4.0)
    emitter = bpy.context.object
    emitter.show_instancer_for_render = False
    emitter.modifiers.new("Sparks", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 8, 1, 6, 30
    settings.render_type, settings.instance_object = "OBJECT", cube
    settings.particle_size, settings.size_random, settings.effector_weights.gravity = 0.8, 0.5, 0.0
    for frame in range(1, 9):
        bpy.context.scene.frame_set(frame)


@pytest.mark.parametrize("output", ["Index", "Random", "Age", "Size", "Velocity"])
def test_instances_show_what_their_particle_is(scene: bpy.types.Scene, render: Render, output: str) -> None:
    particles(show("ShaderNodeParticleInfo", output))
    look_down(scene, 6.0)
    assert_same_picture(render, edge_share=0.3)


def test_without_a_particle_its_random_number_is_that_of_the_first(scene: bpy.types.Scene, render: Render) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(show("ShaderNodeParticleInfo", "Random"))
    look_down(scene, 3.0)
    assert_same_picture(render)


def test_a_node_that_no_renderer_of_paths_has_leaves_the_input_its_own_value(
    scene: bpy.types.Scene, render: Render
) -> None:
    bpy.ops.mesh.primitive_plane_add()
    material = show("ShaderNodeShaderToRGB", "Color")
    emission = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.3, 0.6, 0.1, 1.0)
    bpy.context.object.data.materials.append(material)
    look_down(scene, 3.0)
    assert_same_picture(render)


def test_displacement_shown_as_bump_is_not_darkened_as_a_bump_node_is(scene: bpy.types.Scene, render: Render) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12)
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Rough")
    tree = material.node_tree
    noise, node = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeDisplacement")
    noise.inputs["Scale"].default_value, node.inputs["Scale"].default_value = 4.0, 0.4
    tree.links.new(noise.outputs[0], node.inputs["Height"])
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    bpy.context.object.data.materials.append(material)
    scene.world = bpy.data.worlds.new("White")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    look_down(scene, 1.4)
    ours, theirs = (
        np.mean([render(engine, width=16, height=16, samples=64, seed=seed)[..., :3].mean() for seed in (1, 2)])
        for engine in ("LUCH", "CYCLES")
    )
    assert ours == pytest.approx(theirs, rel=0.01)  # softened as a Bump node it is 3 % darker


def test_an_aovs_alpha_is_one_only_where_the_surface_has_it(scene: bpy.types.Scene, render_passes: Render) -> None:
    material = bpy.data.materials.new("Told")
    node = material.node_tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = "Mine"
    node.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    for x, chosen in ((-1.0, material), (1.0, None)):
        bpy.ops.mesh.primitive_plane_add(location=(x, 0.0, 0.0))
        bpy.context.object.data.materials.append(chosen)
    scene.view_layers[0].aovs.add().name = "Mine"
    look_down(scene, 4.0)
    for engine in ("LUCH", "CYCLES"):
        told: Any = render_passes(engine, width=16, height=16, samples=4)["Mine"]
        assert np.allclose(told[6:10, 2:6], (0.1, 0.2, 0.3, 1.0), atol=1e-3), engine
        assert np.allclose(told[6:10, 10:14], 0.0), engine

"""Surfaces that their materials move, beside Cycles: emission shows where they are and which way they face."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from support.objects import Render, assert_same_picture, look_down, show


def relief(node: str, output: str, method: str, coordinates: str = "Generated") -> bpy.types.Material:
    """A material that shows what a node gives, on noise 0.5 high."""
    material = show(node, output)
    tree = material.node_tree
    material.displacement_method = method
    where, noise = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 3.0
    moves = tree.nodes.new("ShaderNodeDisplacement")
    tree.links.new(where.outputs[coordinates], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], moves.inputs["Height"])
    target = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(moves.outputs[0], target.inputs["Displacement"])
    moves.inputs["Scale"].default_value = 0.5
    return material


def ball(material: bpy.types.Material, smooth: bool = True) -> bpy.types.Object:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16)
    if smooth:
        bpy.ops.object.shade_smooth()
    subject = bpy.context.object
    subject.data.materials.append(material)
    subject.scale, subject.rotation_euler, subject.location = (1.0, 1.3, 0.7), (0.3, 0.2, 0.5), (0.1, 0.2, 0.3)
    return subject


@pytest.mark.parametrize(
    ("coordinates", "output"),
    [
        ("Generated", "Position"),
        ("Object", "Position"),
        ("UV", "Position"),
        ("Normal", "Position"),
        ("Object", "Normal"),
    ],
)
def test_vertices_move_where_cycles_moves_them(
    scene: bpy.types.Scene, render: Render, coordinates: str, output: str
) -> None:
    ball(relief("ShaderNodeNewGeometry", output, "DISPLACEMENT", coordinates))
    look_down(scene, 3.0)
    # Normals change fast within the width of a sample. Weighted by angle, as Blender's own are, nearly all differ.
    assert_same_picture(render, edge_share=0.3 if output == "Normal" else 0.15)


def test_generated_coordinates_stay_with_the_surface(scene: bpy.types.Scene, render: Render) -> None:
    ball(relief("ShaderNodeTexCoord", "Generated", "DISPLACEMENT"))
    look_down(scene, 3.0)
    assert_same_picture(render)


def test_flat_faces_stay_flat(scene: bpy.types.Scene, render: Render) -> None:
    ball(relief("ShaderNodeNewGeometry", "Normal", "DISPLACEMENT"), smooth=False)
    look_down(scene, 3.0)
    assert_same_picture(render, edge_share=0.3)


def test_sharp_edges_of_a_smooth_mesh_are_made_anew(scene: bpy.types.Scene, render: Render) -> None:
    material = relief("ShaderNodeNewGeometry", "Position", "DISPLACEMENT")
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.polygons[5].use_smooth = False
    bpy.context.object.data.materials.append(material)
    look_down(scene, 3.0)
    assert_same_picture(render)


def test_displacement_and_bump_face_as_in_cycles(scene: bpy.types.Scene, render_passes: Callable[..., dict]) -> None:
    ball(relief("ShaderNodeNewGeometry", "Normal", "BOTH"))
    look_down(scene, 3.0)
    scene.view_layers[0].use_pass_normal = True
    ours, theirs = (render_passes(e, width=24, height=24, samples=16)["Normal"] for e in ("LUCH", "CYCLES"))
    assert np.abs(theirs).max() > 0.5
    assert np.median(np.abs(ours - theirs).max(axis=2)) < 0.02


def test_vectors_move_vertices_too(scene: bpy.types.Scene, render: Render) -> None:
    material = relief("ShaderNodeNewGeometry", "Position", "DISPLACEMENT")
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeVectorDisplacement")
    noise = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], node.inputs["Vector"])
    node.space, node.inputs["Midlevel"].default_value = "OBJECT", 0.5
    target = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], target.inputs["Displacement"])
    ball(material)
    look_down(scene, 3.0)
    assert_same_picture(render)


def test_an_image_moves_vertices_of_the_slots_that_show_it(scene: bpy.types.Scene, render: Render) -> None:
    image = bpy.data.images.new("Steps", 8, 8, float_buffer=True)
    steps = np.ones((8, 8, 4), np.float32)
    steps[..., :3] = np.add.outer(np.arange(8), np.arange(8))[..., None] / 14.0
    image.pixels.foreach_set(steps.ravel())
    material = relief("ShaderNodeNewGeometry", "Position", "DISPLACEMENT")
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    moves = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeDisplacement")
    tree.links.new(texture.outputs["Color"], moves.inputs["Height"])
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20)
    subject = bpy.context.object
    subject.data.materials.append(material)
    subject.data.materials.append(show("ShaderNodeNewGeometry", "Position"))
    for face in subject.data.polygons:
        face.material_index = int(face.center.x > 0.3)
    look_down(scene, 2.5)
    assert_same_picture(render)

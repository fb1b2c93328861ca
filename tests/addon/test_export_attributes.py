"""Attributes of meshes: coordinates, tangents, and whatever else a shader asks for."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from luch.scene import Mesh, Scene

from addon.export.cache import MeshCache
from addon.export.context import ExportContext


def read_mesh(subject: bpy.types.Object, *wanted: str) -> Mesh:
    """The evaluated mesh of an object with the wanted attributes."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = subject.evaluated_get(depsgraph)
    mesh = MeshCache().mesh(evaluated, evaluated, set(wanted), ExportContext(depsgraph, Scene()))
    assert mesh is not None
    return mesh


def test_generated_coordinates_stick_to_the_undeformed_mesh(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    cube = bpy.context.object
    bend = cube.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method = "BEND"
    bend.angle = 1.0
    mesh = read_mesh(cube, "generated")
    assert not np.allclose(np.abs(mesh.positions), 1.0)
    assert sorted(map(tuple, np.round(mesh.attributes["generated"].data, 5))) == [
        (x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)
    ]


def test_an_undeformed_mesh_needs_no_generated_attribute(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    mesh = read_mesh(bpy.context.object, "generated")
    assert "generated" not in mesh.attributes
    assert (mesh.texture_location, mesh.texture_size) == ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def test_tangents_follow_u_and_turn_with_a_mirrored_map(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    plane = bpy.context.object
    tangents = read_mesh(plane, "tangent").attributes["tangent"].data
    np.testing.assert_allclose(tangents, [(1.0, 0.0, 0.0, 1.0)] * 6, atol=1e-6)
    for item in plane.data.uv_layers.active.uv:
        item.vector.x = 1.0 - item.vector.x
    tangents = read_mesh(plane, "tangent").attributes["tangent"].data
    np.testing.assert_allclose(tangents, [(-1.0, 0.0, 0.0, -1.0)] * 6, atol=1e-6)


def test_tangents_agree_with_blenders_own_mikktspace(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    bpy.ops.object.shade_smooth()
    monkey.modifiers.new("Triangulate", "TRIANGULATE")
    ours = read_mesh(monkey, "tangent")
    evaluated = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    evaluated.calc_tangents()
    theirs = np.empty(len(evaluated.loops) * 3, dtype=np.float32)
    evaluated.loops.foreach_get("tangent", theirs)
    corners = np.empty(3 * len(evaluated.loop_triangles), dtype=np.int32)
    evaluated.loop_triangles.foreach_get("loops", corners)
    agreement = np.einsum("ij,ij->i", ours.attributes["tangent"].data[:, :3], theirs.reshape(-1, 3)[corners])
    assert (agreement > 0.999).mean() > 0.995, "the rest are vertices whose fans touch in a point only"


def test_attributes_of_every_domain_reach_the_triangles(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_plane_add()
    attributes = bpy.context.object.data.attributes
    attributes.new("Weight", "FLOAT", "POINT").data.foreach_set("value", [0.0, 1.0, 2.0, 3.0])
    attributes.new("Id", "INT", "FACE").data.foreach_set("value", [5])
    attributes.new("Tint", "BYTE_COLOR", "CORNER").data.foreach_set("color_srgb", [1.0, 0.5, 0.0, 1.0] * 4)
    attributes.new("Seam", "FLOAT", "EDGE")
    mesh = read_mesh(bpy.context.object, "Weight", "Id", "Tint", "Seam", "Absent")
    assert mesh.attributes["Weight"].data.ravel().tolist() == [0.0, 1.0, 2.0, 3.0]
    assert mesh.attributes["Id"].data.ravel().tolist() == [5.0, 5.0]
    assert mesh.attributes["Tint"].data.shape == (6, 4)
    assert mesh.attributes["Tint"].data[0] == pytest.approx([1.0, 0.2158605, 0.0, 1.0], abs=1e-3)
    assert {"Seam", "Absent"}.isdisjoint(mesh.attributes)

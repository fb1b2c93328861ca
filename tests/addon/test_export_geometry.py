"""What Blender evaluated arrives as triangles, instances and materials."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from luch.scene import Mesh, Scene
from luch.shader import TRANSPARENT
from support.objects import grid_of_instances

from addon.export import export_scene
from addon.export.instances import name_hash


def export() -> Scene:
    """The scene as it stands, with a camera if it has none."""
    scene = bpy.context.scene
    if scene.camera is None:
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(camera)
        scene.camera = camera
    return export_scene(bpy.context.evaluated_depsgraph_get())


def triangle_area(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def test_a_cube_is_twelve_triangles_of_its_area(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    result = export()
    (mesh,) = result.meshes
    assert mesh.triangles.shape == (12, 3)
    assert triangle_area(mesh) == pytest.approx(24.0)
    assert mesh.normals is None, "a cube is flat"


def test_triangles_turn_as_their_faces_do(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    (mesh,) = export().meshes
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c)
    assert (outward > 0.0).all()


def test_smooth_faces_have_a_normal_per_vertex(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16)
    bpy.ops.object.shade_smooth()
    (mesh,) = export().meshes
    assert mesh.normals_domain == "POINT"
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, mesh.positions, atol=0.02)


def test_mixed_shading_has_normals_per_corner_and_flat_faces_their_triangles_own(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    data = bpy.context.object.data
    smooth = np.arange(len(data.polygons)) % 2 == 0
    data.polygons.foreach_set("use_smooth", smooth)
    (mesh,) = export().meshes
    assert mesh.normals_domain == "CORNER"
    assert mesh.normals is not None
    assert mesh.normals.shape == (3 * len(mesh.triangles), 3)
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    geometric = np.cross(b - a, c - a)
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    flat = np.isclose(mesh.normals.reshape(-1, 3, 3), geometric[:, None], atol=1e-6).all(axis=(1, 2))
    polygons = np.empty(len(data.polygons) and len(mesh.triangles), dtype=np.int32)
    data.loop_triangle_polygons.foreach_get("value", polygons)
    assert flat[~smooth[polygons]].all()
    assert not flat[smooth[polygons]].any()


def test_the_active_uv_map_follows_the_corners(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    (mesh,) = export().meshes
    uv = mesh.attributes[mesh.uv_active]
    assert (uv.domain, uv.data.shape) == ("CORNER", (6, 2))
    corners = mesh.positions[mesh.triangles.reshape(-1)]
    np.testing.assert_allclose(uv.data, corners[:, :2] / 2.0 + 0.5, atol=1e-6)


@pytest.mark.parametrize("kind", ["curve", "text", "metaball", "surface"])
def test_what_blender_turns_into_a_mesh_is_exported_once(scene: bpy.types.Scene, kind: str) -> None:
    if kind == "curve":
        bpy.ops.curve.primitive_bezier_circle_add()
        bpy.context.object.data.bevel_depth = 0.1
    elif kind == "text":
        bpy.ops.object.text_add()
        bpy.context.object.data.extrude = 0.1
    elif kind == "metaball":
        bpy.ops.object.metaball_add()
    else:
        bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    result = export()
    assert result.instances is not None
    assert (len(result.meshes), len(result.instances.object)) == (1, 1)
    assert len(result.meshes[0].triangles) > 50
    assert not result.warnings


def test_linked_duplicates_share_a_mesh(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    source = bpy.context.object
    for index in range(5):
        twin = source.copy()
        twin.location.x = 3.0 * index
        scene.collection.objects.link(twin)
    result = export()
    assert result.instances is not None
    assert len(result.meshes) == 1
    assert len(result.instances.object) == 6
    assert sorted(result.instances.matrix[:, 0, 3]) == [0.0, 0.0, 3.0, 6.0, 9.0, 12.0]


def test_transforms_arrive_as_rows_of_the_world_matrix(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add(location=(1.0, 2.0, 3.0), rotation=(0.3, 0.2, 0.1), scale=(1.0, 2.0, 3.0))
    expected = np.array(bpy.context.object.matrix_world)
    result = export()
    assert result.instances is not None
    np.testing.assert_array_equal(result.instances.matrix[0], expected[:3])


def test_collection_instances_are_multiplied_by_their_instancer(scene: bpy.types.Scene) -> None:
    collection = bpy.data.collections.new("Props")
    bpy.ops.mesh.primitive_cube_add(location=(0.0, 1.0, 0.0))
    cube = bpy.context.object
    scene.collection.objects.unlink(cube)
    collection.objects.link(cube)
    empty = bpy.data.objects.new("Instancer", None)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = collection
    empty.rotation_euler.z = math.pi / 2.0
    scene.collection.objects.link(empty)
    result = export()
    assert result.instances is not None
    assert len(result.instances.object) == 1
    np.testing.assert_allclose(result.instances.matrix[0, :, 3], (-1.0, 0.0, 0.0), atol=1e-6)


def test_geometry_nodes_instances_share_a_mesh_and_differ_in_random(scene: bpy.types.Scene) -> None:
    grid_of_instances(10)
    result = export()
    assert result.instances is not None
    assert (len(result.meshes), len(result.instances.object)) == (1, 100)
    assert len(np.unique(result.instances.random)) == 100
    assert set(np.round(result.instances.matrix[:, 0, 3] + 4.5)) == set(range(10))


def test_objects_switched_off_for_renders_are_absent(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.visible_camera = False
    bpy.context.object.visible_shadow = False
    bpy.ops.mesh.primitive_cube_add()
    for name in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(bpy.context.object, f"visible_{name}", False)
    result = export()
    assert [entry.visibility for entry in result.objects] == [2 + 4 + 8 + 16]


def test_a_holdout_collection_makes_holdouts_and_an_indirect_one_hides_from_the_camera(
    scene: bpy.types.Scene,
) -> None:
    for name in ("Hole", "Indirect"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        bpy.ops.mesh.primitive_cube_add()
        cube = bpy.context.object
        cube.name = name
        for owner in cube.users_collection:
            owner.objects.unlink(cube)
        collection.objects.link(cube)
    children = scene.view_layers[0].layer_collection.children
    children["Hole"].holdout = True
    children["Indirect"].indirect_only = True
    by_name = {entry.name: entry for entry in export().objects}
    assert (by_name["Hole"].holdout, by_name["Hole"].visibility) == (True, 63)
    assert (by_name["Indirect"].holdout, by_name["Indirect"].visibility) == (False, 62)


def test_slots_show_their_materials_and_a_slot_of_the_object_wins(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for name in ("Data", "Replaced"):
        cube.data.materials.append(bpy.data.materials.new(name))
    cube.material_slots[1].link = "OBJECT"
    cube.material_slots[1].material = bpy.data.materials.new("Own")
    cube.data.polygons[0].material_index = 1
    result = export()
    assert [result.materials[index].name for index in result.objects[0].materials] == ["Data", "Own"]
    assert sorted(result.meshes[0].material_slots) == [0] * 10 + [1] * 2


def test_a_material_of_a_volume_alone_has_a_surface_that_lets_light_pass(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    fog = bpy.data.materials.new("Fog")
    fog.node_tree.nodes.clear()
    scatter = fog.node_tree.nodes.new("ShaderNodeVolumeScatter")
    output = fog.node_tree.nodes.new("ShaderNodeOutputMaterial")
    fog.node_tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(fog)
    result = export()
    assert result.warnings == []
    fog_medium = result.materials[0].volume
    assert fog_medium is not None and result.materials[0].only_volume
    assert fog_medium.scattering[0].scattering == pytest.approx((0.8, 0.8, 0.8))
    assert result.materials[0].surface.flags & TRANSPARENT


def test_a_material_override_replaces_every_material(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Own"))
    scene.view_layers[0].material_override = bpy.data.materials.new("Clay")
    result = export()
    assert [material.name for material in result.materials] == ["Clay"]


def test_a_face_that_names_a_missing_slot_shows_the_last(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.materials.append(bpy.data.materials.new("Only"))
    cube.data.attributes.new("material_index", "INT", "FACE").data.foreach_set("value", [7] * 6)
    result = export()
    slots = result.objects[0].materials
    assert all(result.materials[slots[slot]].name == "Only" for slot in result.meshes[0].material_slots)


def test_a_vertex_that_is_not_finite_costs_its_triangles_and_is_named(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.vertices[0].co.x = math.nan
    result = export()
    assert np.isfinite(result.meshes[0].positions).all()
    assert 0 < len(result.meshes[0].triangles) < 12
    (warning,) = result.warnings
    assert 'Mesh "Cube": vertex 0 is not finite' in warning


def test_a_transform_that_is_not_finite_leaves_the_object_out(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.delta_location.x = 3e38
    bpy.context.object.location.x = 3e38  # their sum is infinite
    bpy.ops.mesh.primitive_cube_add()
    result = export()
    assert result.instances is not None
    assert len(result.instances.object) == 1
    assert any("transform is not finite" in warning for warning in result.warnings)


def test_an_unsupported_object_is_named_once(scene: bpy.types.Scene) -> None:
    smoke = bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke"))
    scene.collection.objects.link(smoke)
    (warning,) = export().warnings
    assert warning.startswith('Object "Smoke" is a volume')


def test_name_hash_is_the_one_that_object_info_shows() -> None:
    # hash_uint2(hash_string("Cube"), 0) of Cycles 5.2, read off an Object Info > Random render.
    assert name_hash("Cube") / 0xFFFFFFFF == pytest.approx(0.31314194)


def test_settings_of_an_object_that_change_nothing_yet_are_named(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.name = "Stone"
    cube.modifiers.new("Smooth", "SUBSURF").use_adaptive_subdivision = True
    cube.shadow_terminator_shading_offset = 0.2
    warnings = export().warnings
    assert [word for word in ("adaptive subdivision", "Shading Offset") if any(word in text for text in warnings)] == [
        "adaptive subdivision",
        "Shading Offset",
    ]
    assert all('"Stone"' in text for text in warnings)

"""Hard cases that begin in Blender: nested and mirrored parents, shutters, empty scenes. Numbers: the rows of the list."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from numpy.typing import NDArray
from support.objects import look_down

from addon import engine

Render = Callable[..., NDArray[np.float32]]
SIZE = {"width": 24, "height": 16, "samples": 4}


def lit(scene: bpy.types.Scene, width: float = 6.0) -> None:
    """A camera above, an even world and a sun."""
    look_down(scene, width)
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.2, 0.0))


def suzanne() -> Any:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8)
    return bpy.context.object


@pytest.mark.parametrize("depth", [2, 6])  # Blender draws eight levels
def test_36_nested_collections_mirrored_and_scaled_look_like_a_flat_copy(
    scene: bpy.types.Scene, render: Render, depth: int
) -> None:
    lit(scene)
    subject = suzanne()
    inner = bpy.data.collections.new("Level 0")
    for owner in subject.users_collection:
        owner.objects.unlink(subject)
    inner.objects.link(subject)
    for level in range(1, depth + 1):
        empty = bpy.data.objects.new(f"Instancer {level}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", inner
        empty.scale = (-1.01, 1.0, 0.99)
        empty.location = (0.01, -0.02, 0.0)
        inner = bpy.data.collections.new(f"Level {level}")
        inner.objects.link(empty)
    top = bpy.data.objects.new("Top", None)
    top.instance_type, top.instance_collection = "COLLECTION", inner
    scene.collection.objects.link(top)
    nested = render("LUCH", **SIZE)
    matrix = next(np.array(i.matrix_world) for i in bpy.context.evaluated_depsgraph_get().object_instances
                  if i.is_instance and i.object.type == "MESH")  # fmt: skip
    bpy.data.objects.remove(top)
    flat = bpy.data.objects.new("Flat", subject.data.copy())
    flat.data.transform(Matrix(matrix.tolist()))
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        flat.data.flip_normals()
    scene.collection.objects.link(flat)
    baked = render("LUCH", **SIZE)
    assert nested[..., :3].std() > 1e-3
    assert (np.abs(nested - baked).max(axis=2) > 2e-3).mean() <= 0.05, "edges only"


def test_58_a_shutter_of_no_time_is_none_and_a_short_one_nearly(scene: bpy.types.Scene, render: Render) -> None:
    lit(scene)
    subject = suzanne()
    for frame, x in ((0, -1.0), (2, 1.0)):
        subject.location.x = x
        subject.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    still = render("LUCH", **SIZE)
    scene.render.use_motion_blur = True
    pictures = {}
    for shutter in (0.0, 1e-6, 1.0):
        scene.render.motion_blur_shutter = shutter
        pictures[shutter] = render("LUCH", **SIZE)
        assert np.isfinite(pictures[shutter]).all()
    np.testing.assert_array_equal(pictures[0.0], still)
    assert (np.abs(pictures[1e-6] - still).max(axis=2) > 0.05).mean() <= 0.1
    assert np.abs(pictures[1.0] - still).mean() > 1e-3


def test_63_scenes_that_show_nothing_show_the_world(scene: bpy.types.Scene, render: Render) -> None:
    look_down(scene, 6.0)
    assert render("LUCH", **SIZE)[..., :3].max() == 0.0, "no world: black"
    scene.world = bpy.data.worlds.new("World")
    color = render("LUCH", **SIZE)[..., :3]
    assert color.max() > 0.0 and np.ptp(color) <= 1e-6
    subject = suzanne()
    subject.hide_render = True
    np.testing.assert_array_equal(render("LUCH", **SIZE)[..., :3], color)


@pytest.mark.parametrize("scale", [0.0, 1e-20])
def test_27_an_object_of_no_size_changes_nothing(scene: bpy.types.Scene, render: Render, scale: float) -> None:
    lit(scene)
    suzanne()
    alone = render("LUCH", **SIZE)
    other = suzanne()
    other.scale, other.location = (scale,) * 3, (0.3, 0.2, 2.0)
    np.testing.assert_allclose(render("LUCH", **SIZE), alone, atol=1e-6)


def test_what_no_ray_can_meet_is_named_with_its_object(scene: bpy.types.Scene, render: Render) -> None:
    """The builders' door: faces without area and twins in the statistics, faces out of reach as a warning."""
    lit(scene)
    mesh = bpy.data.meshes.new("Gate")
    far = 3e37
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (far, 0, 0), (0, far, 0), (0, 0, far)]
    mesh.from_pydata(corners, [], [(0, 1, 2), (0, 1, 3), (4, 5, 6)])
    subject = bpy.data.objects.new("Gate", mesh)
    scene.collection.objects.link(subject)
    render("LUCH", **SIZE)
    stats = engine.last_stats[scene.name]
    assert any(told.startswith('Object "Gate": 1 face reaching') for told in stats["warnings"]), stats["warnings"]
    assert stats["geometry_report"] == ['Object "Gate": 1 face without area left out.']

"""The operator that writes a .luch file."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest
from luch.scenefile import read_scene


def test_the_operator_writes_what_a_render_would_see(scene: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    levels = cube.modifiers.new("Smooth", "SUBSURF")
    levels.levels, levels.render_levels = 0, 2
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.hide_render = True
    bpy.ops.object.camera_add()
    scene.camera = bpy.context.object
    scene.render.engine = "CYCLES"
    path = tmp_path / "scene.luch"
    assert bpy.ops.luch.export_scene(filepath=str(path)) == {"FINISHED"}
    (mesh,) = read_scene(path).meshes
    assert len(mesh.triangles) == 12 * 4**2, "the render's subdivision"
    assert scene.render.engine == "CYCLES"


def test_a_scene_that_cannot_be_exported_leaves_no_file(scene: bpy.types.Scene, tmp_path: Path) -> None:
    path = tmp_path / "scene.luch"
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.luch.export_scene(filepath=str(path))
    assert not path.exists()

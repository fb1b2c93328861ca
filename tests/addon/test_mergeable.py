"""Frames of Blender's that merge: farms take parts of one picture's samples."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from luch.cli import main
from luch.merge import read_sums
from support.blender import save_every_pass
from support.pictures import read_passes

from addon.command_line import CommandLineError, overrides


@pytest.fixture
def lit(scene: bpy.types.Scene) -> bpy.types.Scene:
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0.3, 0.0, 6.0))
    scene.camera = bpy.context.object
    render = scene.render
    render.engine = "LUCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 16, 12, 100
    save_every_pass(scene)
    render.use_file_extension = False
    return scene


def test_two_parts_merge_to_the_bits_of_one_render(
    lit: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = {"a": (0, 5), "b": (5, 11)}
    for name, (first, count) in parts.items():
        words = ["--luch-mergeable", "--luch-samples", str(count), "--luch-first-sample", str(first)]
        monkeypatch.setattr("sys.argv", ["blender", "--", *words, "--luch-samples-in-all", "16", "--luch-seed", "3"])
        lit.render.filepath = str(tmp_path / f"{name}.exr")
        bpy.ops.render.render(write_still=True)
    merged = tmp_path / "merged.exr"
    assert main(["merge", *(str(tmp_path / f"{name}.sums.exr") for name in parts), "-o", str(merged)]) == 0
    assert read_sums(tmp_path / "b.sums.exr")[0].first_sample == 5
    monkeypatch.setattr("sys.argv", ["blender", "--", "--luch-samples", "16", "--luch-seed", "3"])
    lit.render.filepath = str(tmp_path / "whole.exr")
    bpy.ops.render.render(write_still=True)
    assert not (tmp_path / "whole.sums.exr").exists(), "nobody asked for it"
    whole = read_passes(tmp_path / "whole.exr")["Combined"]
    np.testing.assert_array_equal(read_passes(merged)["Combined"], whole)


def test_each_view_layer_has_its_file_and_a_lost_frame_leaves_none(
    lit: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["blender", "--", "--luch-mergeable", "--luch-samples", "2"])
    lit.view_layers.new("Second")
    lit.render.filepath = str(tmp_path / "frame.exr")
    bpy.ops.render.render(write_still=True)
    names = {path.name for path in tmp_path.glob("*.sums.exr")}
    assert names == {"frame.ViewLayer.sums.exr", "frame.Second.sums.exr"}


def test_counts_below_0_are_told() -> None:
    with pytest.raises(CommandLineError, match="--luch-first-sample"):
        overrides(("blender", "--", "--luch-first-sample", "-1"))
    assert overrides(("blender", "--", "--luch-mergeable"))["denoise"] is False

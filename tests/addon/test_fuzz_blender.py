"""A short run of the fuzzer through Blender: `build.py fuzz --kinds blender` runs it longer."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest
from fuzz.cases import run_case

SEEDS = range(40, 52)


@pytest.mark.promise(24)
def test_random_files_made_in_blender_render_finite_or_are_refused_by_name(tmp_path: Path) -> None:
    outcomes = [run_case("blender", seed, tmp_path) for seed in SEEDS]  # raises where neither holds
    assert outcomes.count("rendered") > len(SEEDS) / 2


@pytest.mark.promise(14)
@pytest.mark.parametrize("output", ["ShaderNodeOutputLight", "ShaderNodeOutputWorld", "ShaderNodeOutputLineStyle"])
def test_a_material_whose_tree_ends_in_the_output_of_something_else_renders(
    scene: bpy.types.Scene, tmp_path: Path, output: str
) -> None:
    """Found by seed 47: such an output has no volume, or no surface."""
    bpy.ops.mesh.primitive_cube_add()
    material = bpy.data.materials.new("Stray")
    bpy.context.object.data.materials.append(material)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    nodes = material.node_tree.nodes
    nodes.remove(nodes["Material Output"])
    nodes.new(output)
    scene.render.engine, scene.luch.samples = "LUCH", 1
    scene.render.resolution_x = scene.render.resolution_y = 8
    assert bpy.ops.render.render() == {"FINISHED"}

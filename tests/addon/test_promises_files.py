"""What a file may hold: promises 13, 14, 18 and 22 of docs/reliability.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from luch.render import render as render_scene
from luch.scene import Scene
from support.promise_room import picture

from addon import engine


def broken_files(folder: Path) -> list[Path]:
    """Files that look like pictures and are none, or not whole ones."""
    files = []
    for suffix, kind in (("png", "PNG"), ("exr", "OPEN_EXR"), ("jpg", "JPEG"), ("hdr", "HDR"), ("tif", "TIFF")):
        path = folder / f"whole.{suffix}"
        whole = bpy.data.images.new("Whole", 32, 32, float_buffer=True)
        whole.filepath_raw, whole.file_format = str(path), kind
        whole.save()
        data = path.read_bytes()
        files.append(folder / f"cut.{suffix}")
        files[-1].write_bytes(data[: len(data) // 3])
        files.append(folder / f"noise.{suffix}")
        files[-1].write_bytes(data[:16] + np.random.default_rng(3).bytes(400))
    for name, content in (("empty.png", b""), ("text.exr", b"not a picture"), ("zeros.jpg", bytes(300))):
        files.append(folder / name)
        files[-1].write_bytes(content)
    (folder / "folder.png").mkdir()
    return [*files, folder / "folder.png", folder / "missing.png"]


@pytest.mark.promise(13)
def test_pictures_that_cannot_be_read_are_magenta_or_what_is_left_and_named_once(
    room: bpy.types.Scene, tmp_path: Path
) -> None:
    material = bpy.data.objects["Cube"].data.materials[0]
    shader, socket = material.node_tree.nodes["Principled BSDF"], "Emission Color"
    shader.inputs["Emission Strength"].default_value = 1.0
    shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    material.node_tree.links.new(node.outputs[0], shader.inputs[socket])
    magenta = 0
    for path in broken_files(tmp_path):
        node.image = bpy.data.images.new(path.name, 1, 1)
        node.image.source, node.image.filepath = "FILE", str(path)
        seen = picture(room)
        assert np.isfinite(seen).all(), path.name
        told = [text for text in engine.last_stats[room.name]["warnings"] if path.name in text]
        middle = seen[8, 8]
        if told:  # else the reader made something of it, as it does in Blender's image editor
            assert len(told) == 1 and "magenta" in told[0]
            assert middle[0] > 0.9 and middle[2] > 0.9 and middle[1] < 0.2, path.name
            magenta += 1
    assert magenta >= 10, "of 15"


def shader_nodes() -> list[str]:
    """Every node that a material can hold."""
    names = [name for name in dir(bpy.types) if name.startswith("ShaderNode")]
    return [name for name in names if name not in ("ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup")]


NODES_AT_ONCE = 16


@pytest.mark.promise(14)
def test_every_node_there_is_draws_something_finite_or_is_named(room: bpy.types.Scene) -> None:
    cube = bpy.data.objects["Cube"]
    cubes = [cube]
    for k in range(NODES_AT_ONCE):
        cubes.append(cube.copy())
        cubes[-1].data = cube.data.copy()
        cubes[-1].location, cubes[-1].scale = (0.5 * (k % 4) - 0.75, 0.5 * (k // 4) - 0.75, 2.0), (0.24, 0.24, 0.24)
        room.collection.objects.link(cubes[-1])
    drawn, names = 0, shader_nodes()
    for first in range(0, len(names), NODES_AT_ONCE):
        some = names[first : first + NODES_AT_ONCE]
        drawn += sum(show_node(name, shown) for name, shown in zip(some, cubes[1:], strict=False))
        assert np.isfinite(picture(room)).all(), some
        stats = engine.last_stats[room.name]
        assert len(set(stats["warnings"])) == len(stats["warnings"]), some
        assert stats["non_finite_samples"] == 0, some
    assert drawn > 80


def show_node(name: str, cube: Any) -> bool:
    """Gives a cube a material of which one node is all; False if materials cannot hold it."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    try:
        node = tree.nodes.new(name)
    except RuntimeError:  # of another kind of tree
        return False
    sockets = [socket for socket in node.outputs if socket.enabled]
    if sockets:
        where = "Volume" if "Volume" in name else "Surface"
        tree.links.new(sockets[0], tree.nodes["Material Output"].inputs[where])
    cube.data.materials[0] = material
    return True


@pytest.mark.promise(14)
def test_a_node_of_a_later_blender_is_named_and_neutral(room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.export.nodes import tree

    material = bpy.data.objects["Cube"].data.materials[0]
    node = material.node_tree.nodes.new("ShaderNodeTexNoise")
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs[0], shader.inputs["Roughness"])
    monkeypatch.delitem(tree.EMITTERS, "ShaderNodeTexNoise")
    assert np.isfinite(picture(room)).all()
    (told,) = engine.last_stats[room.name]["warnings"]
    assert "Noise Texture" in told and "Stone" in told


@pytest.mark.promise(18)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 3e38, -1e30])
def test_no_number_of_a_file_makes_a_pixel_that_is_none(room: bpy.types.Scene, value: float) -> None:
    material = bpy.data.objects["Cube"].data.materials[0]
    shader = material.node_tree.nodes["Principled BSDF"]
    for name in ("Base Color", "Roughness", "Emission Strength", "IOR"):
        socket = shader.inputs[name]
        if name == "Base Color":
            link_value(material, socket, value)
        else:
            socket.default_value = value
    room.luch.samples = 4
    assert np.isfinite(picture(room)).all()
    assert "non_finite_samples" in engine.last_stats[room.name]


def link_value(material: Any, socket: Any, value: float) -> None:
    node = material.node_tree.nodes.new("ShaderNodeMath")
    node.operation = "DIVIDE"
    node.inputs[0].default_value, node.inputs[1].default_value = value, 1e-30
    material.node_tree.links.new(node.outputs[0], socket)


class AsPreview:
    """The engine, as Blender starts it for the picture of a material: only a window makes those."""

    is_preview = True

    def __init__(self, actual: Any) -> None:
        self._actual = actual

    def __getattr__(self, name: str) -> Any:
        return getattr(self._actual, name)


@pytest.mark.promise(22)
def test_a_preview_takes_few_samples_whatever_the_scene_asks_for(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    room.luch.samples = 5000
    room.render.resolution_x = room.render.resolution_y = 4
    taken: list[int] = []

    def noted(scene: Scene, **named: Any) -> Any:
        taken.append(scene.settings.samples)
        return render_scene(scene, **named)

    original = engine.LuchRenderEngine._render
    monkeypatch.setattr(engine.LuchRenderEngine, "_render", lambda self, graph: original(AsPreview(self), graph))
    monkeypatch.setattr("luch.render.render", noted)
    assert picture(room).shape == (4, 4, 4)
    assert taken == [engine.PREVIEW_SAMPLES]

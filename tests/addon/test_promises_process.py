"""Promises of docs/reliability.md that need a process of their own: it may lose its library, its memory or its home."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from support import checkout

SCENE = """
import bpy, addon
addon.register()
scene = bpy.context.scene
scene.render.engine = "LUCH"
scene.render.resolution_x = scene.render.resolution_y = 16
scene.luch.samples = 1

def render(**options):
    try:
        return bpy.ops.render.render(**options)
    except RuntimeError as error:
        return f"told: {error}"
"""


def blender(script: str, *arguments: str, before: str = "", **environment: str) -> str:
    """What a process with bpy and the add-on prints; it must end well."""
    result = subprocess.run(
        [sys.executable, "-c", before + SCENE + script, *arguments],
        capture_output=True, text=True, errors="replace", timeout=120, check=False,
        env={**checkout.environment(), **environment},
    )  # fmt: skip
    assert result.returncode == 0, result.stdout[-2000:] + result.stderr[-4000:]
    return result.stdout


WITHOUT_CORE = """
import sys

class NoCore:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("luch._core_") and blocked:
            raise ImportError(f"{name}: undefined symbol: PyOldThing")

blocked = True
sys.meta_path.insert(0, NoCore())
"""


@pytest.mark.promise(6)
def test_without_its_library_the_addon_registers_and_a_render_says_why() -> None:
    told = blender(
        """
print("registered:", scene.luch.samples, hasattr(bpy.types, "LUCH_RENDER_PT_effects"))
print("first:", render())
addon.unregister(); addon.register()
blocked = False
scene.render.engine = "LUCH"
print("mended:", render())
""",
        before=WITHOUT_CORE,
    )
    assert "registered: 1 True" in told
    assert "first: told: Error: Luch: its ray tracing core cannot be loaded" in told and "PyOldThing" in told
    assert "mended: {'FINISHED'}" in told


@pytest.mark.promise(7)
def test_without_memory_a_render_says_how_many_bytes_it_needs_and_the_next_one_works() -> None:
    told = blender("""
import resource
print("warm:", render())
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
bpy.ops.mesh.primitive_grid_add(x_subdivisions=500, y_subdivisions=500)  # whose structures take more than is left
grid = bpy.context.object
bpy.context.view_layer.update()
whole = resource.getrlimit(resource.RLIMIT_AS)

from addon import export
original = export.export_scene

def export_then_starve(*arguments, **named):
    result = original(*arguments, **named)
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + room_bytes, whole[1]))
    return result

export.export_scene = export_then_starve
room_bytes = 24 << 20
print("build:", render())
resource.setrlimit(resource.RLIMIT_AS, whole)
bpy.data.objects.remove(grid)
scene.render.resolution_x = scene.render.resolution_y = 4096
room_bytes = 600 << 20
print("film:", render())
resource.setrlimit(resource.RLIMIT_AS, whole)
scene.render.resolution_x = scene.render.resolution_y = 16
print("small:", render())
""")
    for line in ("build: told: Error: Luch: The render needs ", "film: told: Error: Luch: The render needs "):
        found = next(text for text in told.splitlines() if text.startswith(line))
        assert " bytes)" in found and "GiB are free" in found
    assert "small: {'FINISHED'}" in told


@pytest.mark.promise(23)
def test_paths_with_spaces_and_letters_of_all_kinds_and_no_home(tmp_path: Path) -> None:
    folder = tmp_path / "Sömmer ☀ büro"
    folder.mkdir()
    told = blender(
        """
import os, sys
folder = sys.argv[1]
image = bpy.data.images.new("Žluť", 4, 4)
image.generated_color = (0.25, 0.5, 0.75, 1.0)
image.filepath_raw = os.path.join(folder, "bíldo 1.png")
image.file_format = "PNG"
image.save()
material = bpy.data.materials.new("Ünï")
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = bpy.data.images.load(image.filepath_raw)
material.node_tree.links.new(node.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
bpy.data.objects["Cube"].data.materials.clear()
bpy.data.objects["Cube"].data.materials.append(material)
bpy.data.objects["Cube"].name = "Würfel"
scene.render.filepath = os.path.join(folder, "bild 1.exr")
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.use_file_extension = False
print("render:", render(write_still=True))
from addon.engine import capture_scene, last_stats
from luch.scenefile import read_scene, write_scene
captured = capture_scene(scene, bpy.context.view_layer)
write_scene(captured, os.path.join(folder, "szene 1.luch"))
again = read_scene(os.path.join(folder, "szene 1.luch"))
print("same:", again.objects[0].name == captured.objects[0].name, last_stats[scene.name]["warnings"])
from luch.cuda.compiler import cache_folder
print("cache:", cache_folder())
""",
        str(folder),
        HOME="/nonexistent",
        XDG_CACHE_HOME="/proc/no cache",
        LC_ALL="C",
    )
    assert "render: {'FINISHED'}" in told and "same: True []" in told and "cache: None" in told
    assert {path.name for path in folder.iterdir()} == {"bild 1.exr", "bild 1.json", "bíldo 1.png", "szene 1.luch"}

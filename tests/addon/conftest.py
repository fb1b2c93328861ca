"""bpy for the tests of the add-on: registered once per session, from the source tree."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from support import blender
from support.promise_room import prepare


@pytest.fixture(scope="session", autouse=True)
def luch_addon() -> Iterator[None]:
    """The add-on registered in this process's bpy."""
    import addon

    addon.register()
    yield
    addon.unregister()


@pytest.fixture
def scene() -> bpy.types.Scene:
    """An empty scene: no object, no world."""
    return blender.empty_scene()


@pytest.fixture
def render(tmp_path: Path) -> Callable[..., NDArray[np.float32]]:
    """render("LUCH" | "CYCLES", width=, height=, samples=, seed=) -> Combined, float32 (height, width, 4)."""
    return lambda engine, **options: blender.render_combined(engine, tmp_path, **options)


@pytest.fixture
def render_passes(tmp_path: Path) -> Callable[..., dict[str, NDArray[np.float32]]]:
    """Like render, but every pass by Blender's name."""
    return lambda engine, **options: blender.render_passes(engine, tmp_path, **options)


@pytest.fixture
def room(scene: bpy.types.Scene, tmp_path: Path) -> Iterator[bpy.types.Scene]:
    """A cube under a sun before a camera, 16 x 16 pixels, one sample. No handler outlives the test."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Stone"))
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    prepare(scene, tmp_path)
    lists = [getattr(bpy.app.handlers, name) for name in ("render_pre", "render_post", "render_stats")]
    before = [list(handlers) for handlers in lists]
    yield scene
    for handlers, kept in zip(lists, before, strict=True):
        handlers[:] = kept

"""bpy for the tests of the add-on: registered once per session, from the source tree."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from support import blender


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

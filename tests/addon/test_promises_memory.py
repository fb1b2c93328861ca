"""Nothing grows from frame to frame, nothing is left behind: promises 8 and 9 of docs/reliability.md."""

from __future__ import annotations

import gc
import os
from typing import Any

import bpy
import pytest
from support.frames import resident_mib

import addon


def footprint() -> tuple[float, int, int]:
    """Resident MiB, open files, threads."""
    gc.collect()
    return resident_mib(), len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))


def growth_of_frames(scene: bpy.types.Scene, frames: int, skip: int = 10) -> tuple[float, int, int]:
    """MiB a frame, files and threads more, from frame `skip` of an animation to its last."""
    bpy.data.objects["Cube"].modifiers.new("Wave", "WAVE")
    scene.frame_start, scene.frame_end = 1, frames
    scene.render.filepath = scene.render.filepath.replace(".exr", "_####.exr")
    seen: dict[int, tuple[float, int, int]] = {}

    def look(*_: Any) -> None:
        seen[scene.frame_current] = footprint() if scene.frame_current in (skip, frames) else (0.0, 0, 0)

    bpy.app.handlers.render_post.append(look)
    bpy.ops.render.render(animation=True)
    assert len(seen) == frames
    first, last = seen[skip], seen[frames]
    return (last[0] - first[0]) / (frames - skip), last[1] - first[1], last[2] - first[2]


@pytest.mark.promise(8)
def test_frame_after_frame_takes_no_more_memory_files_or_threads(room: bpy.types.Scene) -> None:
    memory, files, threads = growth_of_frames(room, 40)
    if memory > 0.05:  # what a process takes once, it does not take again
        memory = growth_of_frames(room, 40)[0]
    assert memory <= 0.05
    assert (files, threads) == (0, 0)


def growth_of_cycles(scene: bpy.types.Scene, cycles: int, skip: int = 5) -> float:
    """MiB for each time that the add-on is switched off and on, with a render."""
    first = 0.0
    for k in range(cycles):
        if k == skip:
            first = footprint()[0]
        addon.unregister()
        addon.register()
        scene.render.engine, scene.luch.samples = "LUCH", 1
        bpy.ops.render.render()
    return (footprint()[0] - first) / (cycles - skip)


def ours() -> tuple[list[str], list[object], list[str]]:
    """Classes, handlers and properties that the add-on leaves in Blender, while it is switched off."""
    classes = [
        name for name in dir(bpy.types)
        if str(getattr(getattr(bpy.types, name), "__module__", "")).split(".")[0] == "addon" or "LUCH" in name.upper()
    ]  # fmt: skip
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    handlers = [one for some in lists if isinstance(some, list) for one in some if "addon" in str(one.__module__)]
    owners = (
        bpy.types.Scene,
        bpy.types.Object,
        bpy.types.ViewLayer,
        bpy.types.World,
        bpy.types.Material,
        bpy.types.Light,
    )
    return classes, handlers, [owner.__name__ for owner in owners if hasattr(owner, "luch")]


@pytest.mark.promise(9)
def test_switching_the_addon_off_and_on_leaves_nothing_behind(room: bpy.types.Scene) -> None:
    assert growth_of_cycles(room, 20) <= 0.2
    addon.unregister()
    try:
        assert ours() == ([], [], [])
    finally:
        addon.register()

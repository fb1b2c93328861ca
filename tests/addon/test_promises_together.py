"""Renders and whatever else goes on: promises 10, 15, 16, 17 and 21 of docs/reliability.md."""

from __future__ import annotations

import gc
import itertools
import threading
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from luch.scene import Scene
from support.pictures import read_passes
from support.promise_room import F32, heavy, picture, prepare

from addon import engine


def second_scene(folder: Path) -> bpy.types.Scene:
    """A scene beside the room's that shows a bright world."""
    other = bpy.data.scenes.new("Second")
    camera = bpy.data.objects.new("Other camera", bpy.data.cameras.new("Other camera"))
    other.collection.objects.link(camera)
    other.camera = camera
    other.world = bpy.data.worlds.new("Bright")
    other.world.node_tree.nodes["Background"].inputs["Color"].default_value = (4.0, 2.0, 1.0, 1.0)
    prepare(other, folder, 8)
    return other


@pytest.mark.promise(10)
def test_two_scenes_nested_or_from_another_thread_are_never_mixed(room: bpy.types.Scene, tmp_path: Path) -> None:
    other = second_scene(tmp_path)
    expected, bright = picture(room), picture(other)
    assert bright.shape == (8, 8, 4) and np.allclose(bright[..., 0], 4.0)
    nested: list[F32] = []

    def inside(*_: Any) -> None:
        if not nested:
            nested.append(np.zeros((0, 0, 4), np.float32))
            nested.append(picture(other))

    bpy.app.handlers.render_pre.append(inside)
    assert np.array_equal(picture(room), expected)
    bpy.app.handlers.render_pre.remove(inside)
    assert np.array_equal(nested[1], bright)
    seen: list[F32] = []
    worker = threading.Thread(target=lambda: seen.append(picture(other)))
    worker.start()
    worker.join(timeout=60)
    assert np.array_equal(seen[0], bright)
    assert np.array_equal(picture(room), expected)


def of_renders() -> list[object]:
    gc.collect()
    return [thing for thing in gc.get_objects() if isinstance(thing, (engine.Reporter, engine.ResultWriter, Scene))]


@pytest.mark.promise(15)
def test_nothing_of_blender_is_kept_after_a_render(room: bpy.types.Scene, tmp_path: Path) -> None:
    room.render.use_persistent_data = True
    other = second_scene(tmp_path)
    bright = picture(other)
    before = len(of_renders())  # tests that failed on purpose keep theirs in their tracebacks

    def forget(*_: Any) -> None:
        for item in [*bpy.data.objects, *bpy.data.materials, *bpy.data.meshes]:
            bpy.data.batch_remove([item])
        gc.collect()

    bpy.app.handlers.render_post.append(forget)
    assert picture(room).any()
    bpy.app.handlers.render_post.remove(forget)
    assert len(of_renders()) == before
    other.camera = bpy.data.objects.new("New camera", bpy.data.cameras.new("New camera"))
    other.collection.objects.link(other.camera)
    assert np.array_equal(picture(other), bright)


@pytest.mark.promise(17)
def test_after_edits_at_high_rate_the_last_state_is_drawn(room: bpy.types.Scene, tmp_path: Path) -> None:
    """Persistent data keeps meshes from frame to frame: what a script edits in between must not be kept."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "edits.blend"))
    kept = edited_frames(tmp_path, persistent=True)
    for frame, (seen, fresh) in enumerate(zip(kept, edited_frames(tmp_path, persistent=False), strict=True)):
        assert np.array_equal(seen, fresh), f"frame {frame + 1}"


def edited_frames(folder: Path, *, persistent: bool, count: int = 16) -> list[F32]:
    """Pictures of an animation before each frame of which a script makes five edits, the same ones each time."""
    bpy.ops.wm.open_mainfile(filepath=str(folder / "edits.blend"))
    scene, rng = bpy.context.scene, np.random.default_rng(5)
    scene.render.use_persistent_data = persistent
    scene.render.filepath = str(folder / f"{persistent}_")
    scene.render.use_file_extension = True
    scene.frame_start, scene.frame_end = 1, count
    begun: set[int] = set()

    def script(changed: Any, *_: Any) -> None:
        if changed.frame_current not in begun:
            begun.add(changed.frame_current)
            for _ in range(5):
                edit(bpy.data.objects["Cube"], rng)

    bpy.app.handlers.frame_change_pre.append(script)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.frame_change_pre.remove(script)
    scene.render.use_persistent_data = False
    return [read_passes(path)["Combined"] for path in sorted(folder.glob(f"{persistent}_*.exr"))]


def edit(cube: Any, rng: np.random.Generator) -> None:
    kind = int(rng.choice([0, 0, 0, 1, 2, 3, 4, 5, 6]))  # shapes above all
    mesh = cube.data
    if kind == 0:
        mesh.vertices[int(rng.integers(len(mesh.vertices)))].co.x += float(rng.normal(0.0, 0.3))
        mesh.update()
    elif kind == 1:
        cube.data = mesh.copy()
    elif kind == 2:
        cube.location.z = float(rng.normal(0.0, 0.3))
    elif kind == 3:
        mesh.materials[0].node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value[0] = float(rng.random())
    elif kind == 4:
        bpy.context.scene.camera.location.x = float(rng.normal(0.0, 0.1))
    elif kind == 5:
        cube.modifiers.clear()
        cube.modifiers.new("Bevel", "BEVEL").width = float(rng.random() * 0.3)
    else:
        mesh.materials[0] = bpy.data.materials.new("Other")


@pytest.mark.promise(21)
@pytest.mark.parametrize("event", ["undo", "delete", "new scene", "rename", "clear nodes"])
def test_a_change_of_the_file_while_it_renders_changes_nothing_of_the_picture(
    room: bpy.types.Scene, event: str
) -> None:
    room.luch.samples = 300
    expected = picture(room)
    done: list[bool] = []

    def act(*_: Any) -> None:
        if engine.live_stats.get(room.name) or len(done) > 0 or not tick():
            return
        done.append(True)
        change(event)

    ticks = itertools.count()

    def tick() -> bool:
        return next(ticks) >= 3  # the export is over

    bpy.app.handlers.render_stats.append(act)
    seen = picture(room)
    assert done, "it came too late to test anything"
    assert np.array_equal(seen, expected)
    bpy.app.handlers.render_stats.remove(act)
    assert picture(room).shape == expected.shape


def change(event: str) -> None:
    if event == "undo":
        bpy.ops.ed.undo_push(message="A change")
        bpy.ops.ed.undo()
    elif event == "delete":
        bpy.data.batch_remove([thing for thing in bpy.data.objects if thing.type == "MESH"])
        bpy.data.batch_remove([*bpy.data.meshes, *bpy.data.materials])
    elif event == "new scene":
        bpy.data.scenes.remove(bpy.data.scenes.new("Short-lived"))
    elif event == "rename":
        for thing in bpy.data.objects:
            thing.name = "Ünderwegs " + thing.name
    else:
        for material in bpy.data.materials:
            material.node_tree.nodes.clear()


@pytest.mark.promise(16)
def test_other_python_threads_go_on_while_a_picture_is_traced(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    heavy(room)
    room.render.resolution_x = room.render.resolution_y = 64
    room.luch.time_limit = 2.0  # steps double: the last one takes about a second
    ticks: list[float] = []
    over = threading.Event()

    def beat() -> None:
        while not over.wait(0.01):
            ticks.append(time.monotonic())

    heart = threading.Thread(target=beat)
    heart.start()
    began = time.monotonic()
    bpy.ops.render.render()
    seconds = time.monotonic() - began
    over.set()
    heart.join()
    assert len(ticks) >= 10 * seconds
    assert np.diff(ticks).max() < 0.5

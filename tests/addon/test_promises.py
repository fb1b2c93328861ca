"""The promises of docs/reliability.md that one process with bpy can show: nothing that a user does breaks a render."""

from __future__ import annotations

import gc
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from luch.cuda import device as cuda_device
from luch.render import render as render_scene
from luch.scene import Scene
from numpy.typing import NDArray
from support.blender import save_every_pass
from support.endings import LATE_STAGES, STAGES
from support.frames import resident_mib
from support.pictures import read_passes

import addon
from addon import engine

F32 = NDArray[np.float32]
MIB = 1024.0 * 1024.0
CANCEL_S = 0.5  # from the first no to the end of the render
POLL_S = 0.1  # between two questions whether to go on
CI_SLACK = 3.0  # a loaded machine with two processors


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


def prepare(scene: bpy.types.Scene, folder: Path, size: int = 16) -> None:
    render = scene.render
    render.engine = "LUCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = size, size, 100
    save_every_pass(scene)
    render.filepath = str(folder / f"{scene.name}.exr")
    render.use_file_extension = False
    scene.luch.samples = 1


def picture(scene: bpy.types.Scene) -> F32:
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_passes(Path(scene.render.filepath))["Combined"]


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*args: object, **named: object) -> None:
        raise error

    return fail


# -- 1, 2: failed stages ----------------------------------------------------------------------------------------------


@pytest.mark.promise(1)
@pytest.mark.parametrize("stage", STAGES + LATE_STAGES)
def test_any_stage_that_fails_ends_in_an_error_and_the_next_render_is_right(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    room.luch.samples = 2
    with monkeypatch.context() as broken:
        broken.setattr(stage, raising(RuntimeError(f"{stage} broke")))
        with pytest.raises(RuntimeError, match=r"Luch: .*broke \(RuntimeError\)"):
            bpy.ops.render.render(write_still=True)
    assert picture(room).any()


class Unspeakable(Exception):
    """Whose text cannot be had."""

    def __str__(self) -> str:
        raise ValueError("no text")


@pytest.mark.promise(2)
@pytest.mark.parametrize(
    ("error", "told"),
    [(ZeroDivisionError(), "ZeroDivisionError"), (OSError(28, "No space left on device"), "No space left"),
     (MemoryError(), "not enough memory"), (Unspeakable(), "Unspeakable"), (RecursionError("deep"), "deep"),
     (StopIteration(), "StopIteration"), (SystemExit(3), "SystemExit"), (KeyboardInterrupt(), "interrupted")],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_every_exception_reaches_the_user_as_a_sentence(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, error: BaseException, told: str
) -> None:
    monkeypatch.setattr("luch.render.render", raising(error))
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.render.render(write_still=True)


# -- 4: cancel ---------------------------------------------------------------------------------------------------------


def heavy(scene: bpy.types.Scene) -> None:
    """Light that bounces sixty times in a white box, at a size that takes long."""
    cube = bpy.data.objects["Cube"]
    cube.scale = (8.0, 8.0, 8.0)
    scene.render.resolution_x = scene.render.resolution_y = 256
    scene.luch.samples = 1 << 20
    scene.luch.max_bounces = scene.luch.diffuse_bounces = scene.luch.min_light_bounces = 60
    shader = cube.data.materials[0].node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)


@pytest.mark.promise(4)
def test_a_render_asks_ten_times_a_second_whether_to_go_on_and_ends_half_a_second_after_a_no(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    heavy(room)
    asked: list[float] = []

    def stops_after_a_second(self: Any) -> bool:
        asked.append(time.monotonic())
        return asked[-1] - asked[0] > 1.0

    delivered: list[float] = []
    leave = engine.ResultWriter.__exit__

    def noted(self: Any, *args: Any) -> None:
        leave(self, *args)
        delivered.append(time.monotonic())

    monkeypatch.setattr("addon.report.Reporter.user_wants_to_stop", stops_after_a_second)
    monkeypatch.setattr(engine.ResultWriter, "__exit__", noted)
    assert picture(room).shape == (256, 256, 4)
    no = next(moment for moment in asked if moment - asked[0] > 1.0)
    assert delivered[0] - no <= CANCEL_S * CI_SLACK
    gaps = np.diff([moment for moment in asked if moment <= no])
    assert np.median(gaps) <= 1.5 * POLL_S and gaps.max() <= 2 * POLL_S * CI_SLACK
    assert engine.last_stats[room.name]["stopped_by"] == "cancel"


# -- 5, 19: the GPU ----------------------------------------------------------------------------------------------------


@pytest.mark.promise(5)
@pytest.mark.parametrize("reason", ["No CUDA driver that CuPy can use", "CUDA needs CuPy", "compute capability 6.1"])
def test_without_a_gpu_that_can_be_used_the_cpu_renders_and_one_warning_says_why(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    expected = picture(room)
    room.luch.device = "CUDA"
    monkeypatch.setattr("luch.cuda.several.cupy", raising(cuda_device.DeviceError(reason)))
    assert np.array_equal(picture(room), expected)
    assert [text for text in engine.last_stats[room.name]["warnings"] if reason in text] == [
        f"Rendered on the CPU: {reason}"
    ]


class CUDADriverError(RuntimeError):
    """As CuPy raises it."""


CUDADriverError.__module__ = "cupy_backends.cuda.api.driver"


class BrokenRenderer:
    """On a GPU one of whose kernels trapped."""

    def stats(self) -> dict[str, int]:
        return {"film_pixel_bytes": 36}

    def prepare(self) -> bool:
        raise CUDADriverError("CUDA_ERROR_ILLEGAL_ADDRESS: an illegal memory access was encountered")

    def cancel(self) -> None:
        """Nothing runs."""


@pytest.mark.promise(19)
def test_a_kernel_that_faults_is_an_error_and_later_renders_go_to_the_cpu(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = picture(room)
    monkeypatch.setattr(cuda_device, "_lost", [])
    room.luch.device = "CUDA"
    with monkeypatch.context() as once:
        once.setattr("luch.cuda.several.renderer_for", lambda scene: BrokenRenderer())
        with pytest.raises(RuntimeError, match=r"GPU failed while it rendered.*ILLEGAL_ADDRESS.*started again"):
            bpy.ops.render.render(write_still=True)
    assert np.array_equal(picture(room), expected)
    assert "ILLEGAL_ADDRESS" in engine.last_stats[room.name]["warnings"][0]


# -- 8, 9: nothing grows -----------------------------------------------------------------------------------------------


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


# -- 10, 15, 17, 21: whatever else goes on -----------------------------------------------------------------------------


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


# -- 13, 14: what cannot be read, what is not known -------------------------------------------------------------------


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


# -- 16: threads -------------------------------------------------------------------------------------------------------


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


# -- 18, 20, 22 --------------------------------------------------------------------------------------------------------


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

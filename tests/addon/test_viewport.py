"""3D views: what they see, when they render anew, what becomes of them when Blender changes its data.

Blender draws 3D views only in a window, and nobody but Blender makes an engine: a stand-in for the region gives the
view's matrices to the same class that the engine calls.
"""

from __future__ import annotations

import gc
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from luch import core
from luch.cuda import DeviceError
from luch.scene import Film
from mathutils import Matrix
from numpy.typing import NDArray
from support.frames import resident_mib
from support.viewports import (
    HEIGHT,
    WAIT_S,
    WIDTH,
    Window,
    as_fresh,
    depsgraph,
    edits,
    orthographic,
    perspective,
    room_with_a_cube,
    shown,
    update,
)

from addon import report, viewport
from addon.export.context import ExportContext
from addon.export.view import read_view
from addon.viewport import Viewport

F32 = NDArray[np.float32]
MIB = 1024.0 * 1024.0


@pytest.fixture
def room(scene: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """A cube with a material under a sun, a camera, four samples. No renderer outlives the test."""
    room_with_a_cube(scene)
    yield scene
    viewport.stop_all()


# -- What a view sees -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", [perspective(0.4, 0.3, 0.1, -0.05), orthographic(3.0, 2.0, 0.4, 0.1)])
@pytest.mark.parametrize("size", [(60, 40), (31, 77)])
def test_points_lie_where_blender_projects_them(
    room: bpy.types.Scene, projection: Matrix, size: tuple[int, int]
) -> None:
    window = Window(*size)
    data = window.region.data
    data.window_matrix, data.is_perspective = projection, projection[3][3] == 0.0
    data.view_matrix = (Matrix.Translation((1.0, 2.0, 5.0)) @ Matrix.Rotation(0.5, 4, (1, 2, 3))).inverted()
    view = read_view(window.region, window.space_data, ExportContext(depsgraph(), viewport.Scene()))
    film = Film(width=view.width, height=view.height, pixel_aspect=view.pixel_aspect)
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (50, 3))
    ours = core.camera.project(view.camera, film, points - view.origin, view.origin)[:, :2]
    clip = np.c_[points, np.ones(50)] @ np.array(projection @ data.view_matrix).T
    truth = (clip[:, :2] / clip[:, 3:] + 1.0) * 0.5 * size
    assert np.abs(ours - truth).max() < 0.01
    assert view.place(view.width, view.height, None) == (0.0, 0.0, *size)


def test_through_a_camera_its_lens_stays_and_depth_of_field_with_it(room: bpy.types.Scene) -> None:
    room.camera.data.dof.use_dof = True
    room.camera.data.lens = 35.0
    bpy.context.view_layer.update()
    window = Window()
    window.through_camera()
    view = read_view(window.region, window.space_data, ExportContext(depsgraph(), viewport.Scene()))
    assert (view.camera.lens_mm, view.camera.use_dof, view.origin) == (35.0, True, (0.0, 0.0, 6.0))
    assert view.camera.sensor_width_mm / (2.0 * view.camera.lens_mm) == pytest.approx(0.4)


def test_a_border_is_all_that_is_rendered_and_lies_where_the_user_drew_it(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    whole = shown(view, window)
    space = window.space_data
    space.use_render_border = True
    space.render_border_min_x, space.render_border_max_x = 0.25, 0.75
    space.render_border_min_y, space.render_border_max_y = 0.5, 1.0
    part = shown(view, window)
    space.use_render_border = False
    assert part.shape == (20, 30, 4)
    assert np.abs(part - whole[20:, 15:45]).max() < 1e-6
    picture: Any = view.preview.picture
    film = picture.film
    assert picture.tag.place(film.width, film.height, film.border) == (15.0, 20.0, 30.0, 20.0)


def test_a_panorama_fills_the_cameras_frame_alone(room: bpy.types.Scene) -> None:
    room.camera.data.type = "PANO"
    room.camera.data.panorama_type = "EQUIRECTANGULAR"
    room.render.resolution_x, room.render.resolution_y = 200, 100
    bpy.context.view_layer.update()
    window, view = Window(), Viewport()
    window.region.data.window_matrix = perspective(1.5 * 0.36, HEIGHT / WIDTH * 1.5 * 0.36)
    window.through_camera()
    assert shown(view, window).shape == (20, 40, 4)
    picture: Any = view.preview.picture
    assert picture.tag.place(40, 20, (0, 0, 40, 20)) == pytest.approx((10.0, 10.0, 40.0, 20.0), abs=1e-3)


# -- When it renders anew ---------------------------------------------------------------------------------------------


def test_nothing_is_rendered_anew_where_nothing_that_is_seen_changed(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    shown(view, window)
    news = view.preview.news
    for _ in range(3):
        view.update(window, depsgraph())
        view.follow(window, depsgraph())
    bpy.ops.object.select_all(action="SELECT")
    view.update(window, depsgraph())
    assert (view.preview.news, view.preview.busy) == (news, False)


def test_a_view_that_turns_reads_no_mesh(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    before = shown(view, window)
    read = view._cache.read_count
    window.look_from(1.0, 0.0, 5.0)
    view.follow(window, depsgraph())
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None
    assert view._cache.read_count == read
    assert not np.array_equal(view.preview.picture.pixels, before)
    assert np.array_equal(view.preview.picture.pixels, shown(Viewport(), window))


def test_a_view_that_turns_zooms_or_grows_builds_nothing(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    before = shown(view, window)
    for number in range(6):
        window.look_from(0.2 * number, 0.1, 5.0 + number)
        window.region.data.window_matrix = perspective(0.3 + 0.05 * number, 0.3)
        window.region.width = WIDTH + 2 * number
        view.follow(window, depsgraph())
        assert view.preview.wait(WAIT_S) and view.preview.picture is not None
        assert view.preview.stats["reused"] and view.preview.stats["structure_seconds"] == 0.0
        assert np.array_equal(view.preview.picture.pixels, as_fresh(view, window))
    room.luch.preview_samples = 7
    assert not np.array_equal(shown(view, window), before)
    assert view.preview.kept.builds == 1 and view.preview.stats["samples"] == 7
    bpy.data.objects["Cube"].location.x += 0.5
    shown(view, window)
    assert view.preview.kept.builds == 2


def test_a_mesh_that_is_edited_is_seen_as_it_is_edited(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    before = shown(view, window)
    bpy.ops.object.mode_set(mode="EDIT")
    assert np.array_equal(shown(view, window), before)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.5, 0.0, 0.0))
    moved = shown(view, window)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not np.array_equal(moved, before)
    assert np.array_equal(shown(view, window), moved)


def test_images_are_read_again_when_they_change_and_not_else(room: bpy.types.Scene, tmp_path: Path) -> None:
    image = bpy.data.images.new("Paint", 8, 8)
    image.filepath_raw, image.file_format = str(tmp_path / "paint.png"), "PNG"

    def paint(value: float) -> None:
        image.pixels.foreach_set(np.full(256, value, np.float32))
        image.save()

    paint(0.8)
    nodes = bpy.data.materials["Stone"].node_tree.nodes
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    bpy.data.materials["Stone"].node_tree.links.new(texture.outputs[0], nodes["Principled BSDF"].inputs["Base Color"])
    window, view = Window(), Viewport()
    bright = shown(view, window)
    kept = view._scene.images[0]
    bpy.data.objects["Cube"].location.z += 0.1
    shown(view, window)
    assert view._scene.images[0] is kept
    bpy.data.objects["Cube"].location.z -= 0.1
    paint(0.2)
    assert shown(view, window).mean() < 0.9 * bright.mean()


def test_limits_of_the_viewport_are_its_own(room: bpy.types.Scene) -> None:
    luch = room.luch
    luch.samples, luch.quality, luch.use_denoising, luch.verify = 1, "REFERENCE", True, True
    luch.preview_samples, luch.preview_time_limit, luch.preview_error_limit_percent = 7, 30.0, 40.0
    view = Viewport()
    shown(view, Window())
    settings = view._scene.settings
    assert (settings.samples, settings.time_limit, settings.error_limit) == (7, 30.0, pytest.approx(0.4))
    assert (settings.quality, settings.denoise, settings.verify) == ("CUSTOM", False, False)
    assert view.text.startswith("Sample 7/7 | Error ")
    luch.property_unset("preview_samples")
    room.cycles.preview_samples = 3  # as the file was set up for Cycles
    shown(view, Window())
    assert view._scene.settings.samples == 3


def test_the_status_tells_the_error_and_the_seconds_to_the_limit() -> None:
    found = SimpleNamespace(error=0.008, error_low=0.007, error_high=0.009)
    progress = SimpleNamespace(preparing=False, samples=64, total_samples=1024, curve=SimpleNamespace(last=found),
                               asked_error=0.005, forecast=SimpleNamespace(seconds=12.0))  # fmt: skip
    assert report.viewport_line(progress) == "Sample 64/1024 | Error 0.80 % (0.70 to 0.90 %) - 12 s to 0.5 %"


# -- Whatever happens -------------------------------------------------------------------------------------------------


def test_what_cannot_be_shown_is_told_once_and_tried_again_at_the_next_change(
    room: bpy.types.Scene, capfd: pytest.CaptureFixture[str]
) -> None:
    window, view = Window(), Viewport()
    good = shown(view, window)
    place = window.region.data.view_matrix
    window.region.data.view_matrix = Matrix.Diagonal((float("nan"),) * 4)
    for _ in range(5):
        view.update(window, depsgraph())
        view.follow(window, depsgraph())
    assert view.text.startswith("Luch: ") and view.preview.picture is None
    assert capfd.readouterr().err.count("Traceback") == 1
    window.region.data.view_matrix = place
    view.follow(window, depsgraph())  # the view has changed, not the file
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None
    assert np.array_equal(view.preview.picture.pixels, good)
    assert view.text.startswith("Sample")


def test_without_its_library_a_view_says_why_and_goes_on_once_it_is_there(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    engine = SimpleNamespace(update_stats=lambda _, text: said.append(text))
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "luch.preview", None)
        assert viewport.of_engine(engine) is None
    assert len(said) == 1 and said[0].startswith("Luch: its ray tracing core cannot be loaded")
    assert viewport.of_engine(engine) is viewport.of_engine(engine) is not None


def test_what_a_picture_does_otherwise_is_noted_in_the_status_and_told_once(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def none() -> None:
        raise DeviceError("CUDA needs CuPy")

    monkeypatch.setattr("luch.cuda.several.cupy", none)
    room.luch.device = "CUDA"
    window, view = Window(), Viewport()
    shown(view, window)
    window.look_from(0.0, 0.0, 4.0)
    shown(view, window)
    assert view.text.endswith(" | 1 note in the console")
    assert capfd.readouterr().err.count("Luch: Rendered on the CPU: ") == 1


@pytest.mark.promise(17)
def test_after_edits_at_high_rate_a_view_shows_the_last_state(room: bpy.types.Scene) -> None:
    window, view = Window(), Viewport()
    edits(120, 1.0, window, view)
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None, view.text
    assert np.array_equal(view.preview.picture.pixels, as_fresh(view, window))


def other_file() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def deleted() -> None:
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials])


def undone() -> None:
    for message in ("A change", "Another"):
        bpy.ops.ed.undo_push(message=message)
    bpy.ops.ed.undo()


@pytest.mark.promise(21)
@pytest.mark.parametrize("event", [undone, deleted, other_file])
def test_undo_and_other_files_while_a_view_renders_change_nothing_of_its_picture(
    room: bpy.types.Scene, event: Callable[[], None]
) -> None:
    expected = shown(Viewport(), Window())
    room.luch.preview_samples = 200
    expected_long = shown(Viewport(), Window())
    view = Viewport()
    view.update(Window(), depsgraph())
    assert view.preview.busy
    event()
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None
    assert np.array_equal(view.preview.picture.pixels, expected_long)
    assert not np.array_equal(expected, expected_long)


def test_a_view_that_blender_closes_ends_its_thread(room: bpy.types.Scene) -> None:
    room.luch.preview_samples = 1 << 20
    view = Viewport()
    view.update(Window(), depsgraph())
    gone, preview = weakref.ref(view), view.preview
    assert preview.busy
    del view
    assert gone() is None
    assert preview.wait(2.0)


def footprint() -> tuple[float, int]:
    """Resident MiB, threads."""
    gc.collect()
    return resident_mib(), threading.active_count()


@pytest.mark.promise(8)
def test_update_after_update_a_view_takes_no_more_memory_or_threads(room: bpy.types.Scene) -> None:
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    bpy.data.objects["Cube"].modifiers.new("Fine", "SUBSURF").levels = 5
    room.luch.preview_samples = 1
    window, view = Window(), Viewport()
    marks = []
    for number in range(100):
        bpy.data.objects["Cube"].location.x = 0.01 * number
        bpy.data.meshes["Cube"].vertices[0].co.x += 0.001
        bpy.data.meshes["Cube"].update()
        update(view, window)
        if number % 10 == 9:  # the others are cut off by the next
            shown(view, window)
        if number in (29, 99):
            marks.append(footprint())
    assert marks[1][0] - marks[0][0] < 0.1 * 70, marks
    assert marks[1][1] == marks[0][1]


def test_particle_hair_is_read_again_when_it_changes_and_not_else(room: bpy.types.Scene) -> None:
    cube = bpy.data.objects["Cube"]
    bpy.context.view_layer.objects.active = cube
    bpy.ops.object.particle_system_add()
    settings = cube.particle_systems[0].settings
    settings.type, settings.count, settings.display_step, settings.render_step = "HAIR", 20, 2, 5
    window, view = Window(), Viewport()
    shown(view, window)
    curves = view._scene.meshes[-1].curves
    assert curves.points.shape == (20 * 5, 4)  # steps of views, not of renders
    bpy.data.objects["Sun"].location.z += 0.1
    shown(view, window)
    assert view._scene.meshes[-1].curves is curves
    settings.hair_length = 0.5
    before = view.preview.picture
    shown(view, window)
    assert view._scene.meshes[-1].curves is not curves
    assert not np.array_equal(view.preview.picture.pixels, before.pixels)
    assert np.array_equal(view.preview.picture.pixels, shown(Viewport(), window))

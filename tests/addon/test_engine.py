"""Blender renders with Luch: files, passes, cancelling, and every way to fail."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO as oiio
import pytest
from luch.scene import Scene
from support.blender import save_every_pass
from support.pictures import read_passes

from addon import engine, report, result


@pytest.fixture
def room(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    """A cube under a sun before a camera, 16x12 pixels, one sample, saved as multilayer EXR."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Stone"))
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    render = scene.render
    render.engine = "LUCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 16, 12, 100
    save_every_pass(scene)
    render.filepath = str(tmp_path / "frame.exr")
    render.use_file_extension = False
    scene.luch.samples = 1
    return scene


def picture(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Render and read back every pass."""
    bpy.ops.render.render(write_still=True)
    return read_passes(Path(scene.render.filepath))


def metadata(path: Path) -> dict[str, Any]:
    spec = oiio.ImageInput.open(str(path)).spec()
    return {attribute.name: attribute.value for attribute in spec.extra_attribs}


def cancel_after(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """The user presses Escape some seconds into the render."""
    start = time.monotonic()
    monkeypatch.setattr("addon.report.Reporter.user_wants_to_stop", lambda self: time.monotonic() - start > seconds)


def test_a_render_writes_its_file(room: bpy.types.Scene) -> None:
    combined = picture(room)["Combined"]
    assert combined.shape == (12, 16, 4)
    assert np.isfinite(combined).all()
    assert combined.any()


def test_every_pass_arrives_under_blenders_name(room: bpy.types.Scene) -> None:
    layer = room.view_layers[0]
    switches = [name for name in dir(layer) if name.startswith("use_pass_") and name != "use_pass_grease_pencil"]
    for name in switches:
        setattr(layer, name, True)
    for name in ("denoising", "sample_count", "render_time", "error", "reliability"):
        setattr(layer.luch, f"use_pass_{name}", True)
    for name, kind in (("Mask", "VALUE"), ("Tint", "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    layer.lightgroups.add().name = "Key"
    passes = picture(room)
    expected = {
        "Combined": 4,
        "Depth": 1,
        "Normal": 3,
        "Sample Count": 1,
        "Render Time": 1,
        "Error": 3,
        "Reliability": 1,
        "CryptoObject00": 4,
        "Mask": 1,
        "Tint": 4,
    }
    expected |= {"Combined_Key": 3, "Diffuse Direct": 3, "Denoising Albedo": 3, "UV": 3, "Object Index": 1}
    assert {name: passes[name].shape[2] for name in expected} == expected


def test_the_picture_before_denoising_arrives_where_denoising_is_on(room: bpy.types.Scene) -> None:
    plain = picture(room)
    assert "Noisy Image" not in plain
    room.luch.use_denoising = True
    denoised = picture(room)
    assert np.array_equal(denoised["Noisy Image"], plain["Combined"])
    assert not np.array_equal(denoised["Combined"], plain["Combined"])


def test_an_aov_may_have_the_name_of_a_pass_that_is_off(room: bpy.types.Scene) -> None:
    layer = room.view_layers[0]
    for name in ("Depth", "Error", "Sample Count", "Combined_Key", "CryptoObject00"):
        layer.aovs.add().name = name
    passes = picture(room)
    assert passes["Depth"].shape[2] == passes["Error"].shape[2] == passes["CryptoObject00"].shape[2] == 4
    layer.luch.use_pass_error = True
    layer.lightgroups.add().name = "Key"
    passes = picture(room)
    assert passes["Error"].shape[2] == passes["Combined_Key"].shape[2] == 3
    warnings = engine.last_stats[room.name]["warnings"]
    assert [name for name in ("Depth", "Error", "Combined_Key") if any(f'"{name}"' in text for text in warnings)] == [
        "Error",
        "Combined_Key",
    ]


def test_a_cropped_border_is_as_large_as_blender_wants_it(room: bpy.types.Scene) -> None:
    render = room.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.3, 0.61, 0.2, 0.77
    assert picture(room)["Combined"].shape == (7, 5, 4)
    render.use_crop_to_border = False
    assert picture(room)["Combined"].shape == (12, 16, 4)


def test_borders_are_cut_where_blender_cuts_them(room: bpy.types.Scene) -> None:
    render = room.render
    render.use_border = render.use_crop_to_border = True
    random = np.random.default_rng(5)
    edges = [0.0, 0.1, 0.2, 0.3, 0.6, 0.7, 0.9, 1.0, *random.random(8)]
    for _ in range(24):
        render.resolution_x, render.resolution_y = (int(n) for n in random.integers(10, 60, 2))
        render.border_min_x, render.border_max_x = sorted(random.choice(edges, 2, replace=False))
        render.border_min_y, render.border_max_y = sorted(random.choice(edges, 2, replace=False))
        assert bpy.ops.render.render() == {"FINISHED"}


@pytest.mark.promise(22)
@pytest.mark.parametrize("size", [(4, 4), (5, 17)])
def test_tiny_frames_render(room: bpy.types.Scene, size: tuple[int, int]) -> None:
    room.render.resolution_x, room.render.resolution_y = size
    assert picture(room)["Combined"].shape == (size[1], size[0], 4)


def test_every_view_layer_is_rendered(room: bpy.types.Scene) -> None:
    room.view_layers.new("Second")
    bpy.ops.render.render(write_still=True)
    names = [part.getattribute("name") for part in parts(Path(room.render.filepath))]
    assert any(name.startswith("Second.Combined") for name in names)
    assert any(name.startswith("ViewLayer.Combined") for name in names)


def parts(path: Path) -> list[Any]:
    """The specs of an EXR's parts."""
    file = oiio.ImageInput.open(str(path))
    specs = []
    while file.seek_subimage(len(specs), 0):
        specs.append(file.spec())
    return specs


def test_statistics_are_kept_and_written_into_the_file(room: bpy.types.Scene) -> None:
    room.luch.seed = 7
    picture(room)
    stats = engine.last_stats[room.name]
    assert (stats["samples"], stats["seed"], stats["device"], stats["warnings"]) == (1, 7, "CPU", [])
    json.dumps(stats)
    header = metadata(Path(room.render.filepath))
    assert header["luch.ViewLayer.samples"] == "1"
    assert header["luch.ViewLayer.seed"] == "7"
    assert stats["effects"]["sun lamps"]["reason"] == '"Sun"'
    assert header["luch.ViewLayer.effects"].startswith("sun lamps, ")
    assert len(header["luch.ViewLayer.effects"]) < 500, "names alone: reasons are for the statistics"
    assert "error" not in stats, "one sample has no second part"
    room.luch.samples = 2
    picture(room)
    stats = engine.last_stats[room.name]
    header = metadata(Path(room.render.filepath))
    for key in ("error", "error_low", "error_high", "fireflies_share"):
        assert float(header[f"luch.ViewLayer.{key}"]) == pytest.approx(stats[key])


def test_a_headless_render_says_why_it_ended_and_leaves_all_it_knows_beside_its_frame(
    room: bpy.types.Scene, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["blender", "--", "--luch-error", "0.5", "--luch-time", "60"])
    picture(room)
    stats = json.loads(Path(room.render.filepath).with_suffix(".json").read_text())
    assert stats["stopped_by"] == "error" and stats["error"] <= 0.5 and stats["samples"] < 200
    assert (stats["error_asked"], stats["time_asked"], stats["samples_asked"]) == (0.5, 60.0, 65536)
    assert stats["error_low"] <= stats["error"] <= stats["error_high"] and len(stats["error_curve"]) >= 1
    line = next(text for text in capfd.readouterr().out.splitlines() if text.startswith("Luch: "))
    assert f"{stats['samples']} samples in " in line and line.endswith("error reached")
    header = metadata(Path(room.render.filepath))
    assert header["luch.ViewLayer.stopped_by"] == "error"
    monkeypatch.setattr("sys.argv", ["blender", "--", "--luch-error", "0.000001", "--luch-time", "0.3"])
    picture(room)
    stats = json.loads(Path(room.render.filepath).with_suffix(".json").read_text())
    assert stats["stopped_by"] == "time" and stats["total_seconds"] < 2.0


def test_cryptomatte_carries_its_manifest(room: bpy.types.Scene) -> None:
    room.view_layers[0].use_pass_cryptomatte_object = True
    picture(room)
    header = metadata(Path(room.render.filepath))
    names = [key for key in header if key.startswith("cryptomatte/") and key.endswith("/manifest")]
    (manifest,) = [json.loads(header[key]) for key in names]
    assert set(manifest) == {"Cube"}
    assert len(manifest["Cube"]) == 8


def test_a_cancelled_render_returns_at_once_with_the_film_so_far(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    room.luch.samples = 1 << 20
    cancel_after(monkeypatch, 0.5)
    start = time.monotonic()
    combined = picture(room)["Combined"]
    assert time.monotonic() - start < 0.5 + 0.5 + 1.0, "Blender itself may take a second for the file"
    assert combined.any()
    assert engine.last_stats[room.name]["cancelled"]


def test_the_picture_is_shown_while_it_grows(room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[float] = []
    original = result.ResultWriter.show

    def spy(self: Any, passes: Any) -> None:
        original(self, passes)
        shown.append(float(passes["Combined"].sum()))

    monkeypatch.setattr(result.ResultWriter, "show", spy)
    monkeypatch.setattr(report, "is_watched", lambda: True)
    monkeypatch.setattr(report, "FIRST_PICTURE_S", 0.0)
    room.luch.samples = 16
    combined = picture(room)["Combined"]
    assert len(shown) >= 2
    assert shown[-1] == pytest.approx(float(combined.sum()), rel=0.2)


def test_an_animation_renders_its_frames(room: bpy.types.Scene, tmp_path: Path) -> None:
    room.frame_start, room.frame_end = 3, 4
    room.render.filepath = str(tmp_path / "walk_")
    room.render.use_file_extension = True
    bpy.ops.render.render(animation=True)
    assert sorted(path.name for path in tmp_path.glob("walk_*.exr")) == ["walk_0003.exr", "walk_0004.exr"]
    records = {path.name: json.loads(path.read_text()) for path in tmp_path.glob("walk_*.json")}
    assert {name: stats["frame"] for name, stats in records.items()} == {"walk_0003.json": 3, "walk_0004.json": 4}


def test_persistent_data_reads_only_what_changed(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    wave = monkey.modifiers.new("Wave", "WAVE")
    wave.height = 1.0
    room.frame_start, room.frame_end = 1, 3
    room.render.filepath = str(tmp_path / "walk_")
    room.render.use_persistent_data = True
    caches = spy_on_caches(monkeypatch)
    bpy.ops.render.render(animation=True)
    room.render.use_persistent_data = False
    assert len({id(cache) for cache in caches}) == 1
    assert caches[0].read_count == 2 + 1 + 1, "cube and monkey, then twice the monkey, which the wave deforms"


def spy_on_caches(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Every mesh cache that a render uses, in order."""
    caches: list[Any] = []
    original = engine.LuchRenderEngine._mesh_cache

    def spy(self: Any, depsgraph: Any) -> Any:
        caches.append(original(self, depsgraph))
        return caches[-1]

    monkeypatch.setattr(engine.LuchRenderEngine, "_mesh_cache", spy)
    return caches


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*args: object, **named: object) -> None:
        raise error

    return fail


STAGES = ("addon.export.export_scene", "luch.render.render", "addon.result.ResultWriter.write")
ERRORS = (
    ValueError("it broke"),
    MemoryError(),
    KeyboardInterrupt(),
    RuntimeError("deep\n  inside"),
    ImportError("no core"),
)


@pytest.mark.promise(1)
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_whatever_fails_becomes_an_error_and_the_next_render_works(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, stage: str, error: BaseException
) -> None:
    room.view_layers[0].use_pass_z = True
    with monkeypatch.context() as broken:
        broken.setattr(stage, raising(error))
        with pytest.raises(RuntimeError, match="Luch: "):
            bpy.ops.render.render(write_still=True)
    assert not Path(room.render.filepath).exists(), "no black picture may pass for a render"
    assert picture(room)["Combined"].any()


def test_a_film_of_the_wrong_size_becomes_an_error(room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(scene: Scene, progress: object = None) -> Any:
        from luch.render import Result

        return Result({"Combined": np.zeros((3, 3, 4), np.float32)}, {})

    monkeypatch.setattr("luch.render.render", wrong)
    with pytest.raises(RuntimeError, match='Pass "Combined": Blender wants 768 floats'):
        bpy.ops.render.render(write_still=True)


def test_a_scene_without_camera_is_an_error_with_its_remedy(room: bpy.types.Scene) -> None:
    room.camera = None
    with pytest.raises(RuntimeError, match=r"(?i)no camera"):
        bpy.ops.render.render(write_still=True)


def test_an_empty_scene_renders(room: bpy.types.Scene) -> None:
    for thing in list(room.objects):
        if thing.type != "CAMERA":
            bpy.data.objects.remove(thing)
    assert not picture(room)["Combined"][..., :3].any()


def test_a_vertex_that_is_not_finite_is_survived_and_named(room: bpy.types.Scene) -> None:
    bpy.data.objects["Cube"].data.vertices[0].co.z = math.nan
    assert np.isfinite(picture(room)["Combined"]).all()
    assert "vertex 0 is not finite" in engine.last_stats[room.name]["warnings"][0]


def test_the_addon_can_be_switched_off_and_on_again(room: bpy.types.Scene) -> None:
    import addon

    for _ in range(3):
        addon.unregister()
        assert not hasattr(bpy.types.Scene, "luch")
        addon.register()
    assert picture(room)["Combined"].any()

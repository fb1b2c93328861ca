"""The wavefront of CUDA against the CPU's renderer: the same paths, so the same picture but for the order of sums.

On fibers (tests/support/cuda_on_cpu.py) always; on a GPU with `-m cuda`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import samplers
from luch._native import core
from luch.cuda import compiler, device, several
from luch.cuda import render as device_render
from luch.cuda.render import DeviceRenderer
from luch.cuda.scene_kernels import STAGES
from luch.kept import Kept
from luch.render import Progress, render
from luch.scene import Image, Instances, Light, Material, Scene
from luch.shader import ProgramBuilder
from support.combinations import covering_rows, scene_of
from support.cuda_on_cpu import FIBERS
from support.devices import both, check_equal
from support.effects import closure, program
from support.everything import everything

LIGHT_PASSES = ["Emission", "Environment", "Ambient Occlusion", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color",
                "Glossy Direct", "Glossy Indirect", "Glossy Color", "Transmission Direct", "Transmission Indirect",
                "Transmission Color"]  # fmt: skip
FIRST_PASSES = ["Depth", "Position", "Object Index", "Material Index"]
DATA_PASSES = ["Mist", "Normal", "UV", "Denoising Albedo", "Denoising Normal", "CryptoObject00", "CryptoMaterial00"]


def test_the_picture_is_the_cpus(place: str) -> None:
    cpu, cpu_stats, ours, stats = both(everything())
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert cpu["Combined"][..., :3].mean() > 0.05
    for name in ("paths", "rays", "shadow_rays", "surface_points", "transparent_steps", "world_points", "light_points"):
        assert abs(stats[name] - cpu_stats[name]) <= (0 if place == FIBERS else 0.01 * cpu_stats[name]), name


def test_every_pass_is_the_cpus(place: str) -> None:
    scene = everything()
    film = replace(scene.film, passes=["Combined", *LIGHT_PASSES, *FIRST_PASSES, *DATA_PASSES], cryptomatte_depth=4)
    cpu, _, ours, _ = both(replace(scene, film=film))
    for name in cpu:
        check_equal(name, cpu[name], ours[name], place)


def test_the_error_is_the_cpus(place: str) -> None:
    _, cpu, _, ours = both(everything())
    assert ours["error"] == pytest.approx(cpu["error"], rel=1e-4 if place == FIBERS else 0.05)


@pytest.mark.parametrize("gpus", [[0], [0, 0]])
def test_another_view_is_the_cpus_and_nothing_is_built_or_uploaded_for_it(
    place: str, gpus: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    if len(gpus) > 1:
        monkeypatch.setattr(several, "usable_devices", lambda: gpus)
    scene, kept = everything(), Kept()
    scene.images = [Image("Of nothing", np.zeros((37, 41, 4), np.uint8))]  # filled up to whole tiles on the GPU
    on_device = replace(scene, settings=replace(scene.settings, device="CUDA", gpus=len(gpus)))
    render(on_device, kept=kept)
    turned = np.array([[1.0, 0, 0, -0.3], [0, 0.98, -0.199, 0.1], [0, 0.199, 0.98, 5.0]])
    uploads = []
    monkeypatch.setattr(device_render, "DeviceCopy", lambda *given: uploads.append(given))
    films = [replace(scene.film, width=31, height=9), replace(scene.film, border=(2, 3, 12, 11))]
    for number, film in enumerate(films):
        camera = replace(scene.camera, matrix=turned, lens_mm=30.0 + number)
        settings = replace(on_device.settings, samples=3 + number, max_bounces=4)
        ours = render(replace(on_device, camera=camera, film=film, settings=settings), kept=kept)
        cpu = render(replace(scene, camera=camera, film=film, settings=replace(settings, device="CPU")))
        check_equal("Combined", cpu.passes["Combined"], ours.passes["Combined"], place)
        assert ours.stats["device"].startswith("CUDA") and ours.stats["reused"]
        if place == FIBERS:
            assert ours.stats["paths"] == cpu.stats["paths"]
        kept.rest()  # as a view that stands still
    check_after_a_wave_that_was_cut_off(scene, on_device, kept, place, monkeypatch)
    assert kept.builds == 1 and not uploads and kept._held is not None
    host = core.render.Renderer(scene)
    assert host.prepare()
    assert kept._held.renderer.origin_reach() == pytest.approx(host.origin_reach(), rel=1e-5)


def check_after_a_wave_that_was_cut_off(
    scene: Scene, on_device: Scene, kept: Kept, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace_round = DeviceRenderer._trace_round

    def and_abandon(self: DeviceRenderer, turn: int, rays: int) -> int:
        self.abandon()
        return trace_round(self, turn, rays)

    monkeypatch.setattr(DeviceRenderer, "_trace_round", and_abandon)
    cut_off = render(on_device, kept=kept)
    monkeypatch.setattr(DeviceRenderer, "_trace_round", trace_round)
    whole, cpu = render(on_device, kept=kept), render(scene)
    assert 0 < cut_off.stats["rays"] < whole.stats["rays"]
    check_equal("Combined", cpu.passes["Combined"], whole.passes["Combined"], place)


def plain() -> Scene:
    """A floor under one lamp: nothing else."""
    scene = everything(max_bounces=2)
    instances = scene.instances
    assert instances is not None
    one = Instances(*(getattr(instances, name)[:1] for name in ("object", "matrix", "random", "generated", "uv")))
    return replace(scene, meshes=scene.meshes[:1], objects=scene.objects[:1], instances=one, lights=scene.lights[:1],
                   materials=[Material("Chalk", program(chalk))], world=None)  # fmt: skip


@pytest.mark.parametrize("kind", ["FISHEYE_EQUIDISTANT", pytest.param("FISHEYE_EQUISOLID", marks=pytest.mark.cuda)])
def test_a_fisheyes_circle_is_the_cpus_and_nothing_is_seen_beside_it(place: str, kind: str) -> None:
    scene = everything()
    lens = replace(scene.camera, kind=kind, fisheye_fov=2.5, fisheye_lens_mm=8.0)
    cpu, _, ours, _ = both(replace(scene, camera=lens))
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert (ours["Combined"][0, 0] == (0.0, 0.0, 0.0, 1.0)).all()
    assert ours["Combined"][..., :3].any()


@pytest.mark.parametrize("spread", [math.pi, 1.0, 0.0])
def test_area_lamps_of_every_shape_that_a_batch_samples_together_are_those_of_one_point(
    place: str, spread: float
) -> None:
    scene = everything()
    shapes = {"SQUARE": 0.5, "RECTANGLE": 3.0, "DISK": 0.02, "ELLIPSE": 2.0}  # near and far ones, narrow and wide
    lamps = [
        Light(shape, "AREA", np.array(((1, 0, 0, i - 1.5), (0, 1, 0, -0.5), (0, 0, 1, 2.5)), float), power=20.0,
              shape=shape, size=size, size_y=0.5 * size, spread=spread)
        for i, (shape, size) in enumerate(shapes.items())
    ]  # fmt: skip
    cpu, _, ours, _ = both(replace(scene, lights=[*lamps, *scene.lights]))
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert cpu["Combined"][..., :3].mean() > render(scene).passes["Combined"][..., :3].mean()


def chalk(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.6, 0.5, 0.4)})


def test_code_for_what_the_scene_lacks_changes_no_bit(place: str) -> None:
    scene = plain()
    everything_compiled = replace(scene, settings=replace(scene.settings, device="CUDA", force_effects=["ALL"]))
    full = render(everything_compiled)
    lean = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert np.array_equal(full.passes["Combined"], lean.passes["Combined"])
    assert lean.passes["Combined"][..., :3].max() > 0.1
    absent = {name for name, needed in lean.stats["kernel_plan"].items() if not needed}
    assert absent >= {"THIN_FILM", "MICROFACETS", "SUNS", "EMISSIVE_MESHES", "WORLD_SAMPLING", "LIGHT_PASSES", "SHEEN",
                      "AREA_LAMPS", "LAMP_PROGRAMS", "EMISSION_PROGRAMS", "WORLD_PROGRAM"}  # fmt: skip
    assert lean.stats["kernel_plan"]["ROUND_LAMPS"]


def test_the_render_time_adds_up_to_the_time_of_tracing_and_changes_no_other_pass(place: str) -> None:
    """On fibers one clock, which all threads share, stands for each one's."""
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA"))
    without = render(scene)
    asking = replace(scene, film=replace(scene.film, passes=["Combined", "Render Time"]))
    render(asking)  # on a GPU kernels with clocks are compiled when they are first used, within the time of tracing
    timed = render(asking)
    assert timed.stats["kernel_plan"]["TIME"] and not without.stats["kernel_plan"]["TIME"]
    assert np.array_equal(without.passes["Combined"], timed.passes["Combined"])
    milliseconds = timed.passes["Render Time"][..., 0]
    assert (milliseconds > 0.0).all()
    assert 1e-3 * milliseconds.sum(dtype=np.float64) == pytest.approx(timed.stats["trace_seconds"], rel=0.05)
    assert timed.stats["device_film_and_paths_bytes"] > without.stats["device_film_and_paths_bytes"]


def test_a_picture_larger_than_a_wave_is_the_same(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA"))
    whole = render(scene)
    monkeypatch.setattr(device_render, "MOST_PATHS", 96)  # of 280 pixels
    monkeypatch.setattr(device_render, "FEWEST_PATHS", 96)
    parts = render(scene)
    assert parts.stats["paths_at_once"] == 96
    assert np.array_equal(whole.passes["Combined"], parts.passes["Combined"])


def test_a_cancel_keeps_the_samples_so_far(place: str) -> None:
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA", samples=1 << 14))

    def stop(progress: Progress) -> bool:
        return progress.samples == 0

    result = render(scene, progress=stop)
    assert result.cancelled
    assert 1 <= result.stats["samples"] < 1 << 14
    assert result.passes["Combined"][..., :3].mean() > 0.01


@pytest.mark.promise(7)
def test_too_little_memory_is_told_with_its_remedy(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA"))
    monkeypatch.setattr(device_render, "MEMORY_SHARE", 1e-9)
    with pytest.raises(device.DeviceError, match=r"GiB free; the film of this picture and .* paths need more"):
        render(scene)


def in_regions(scene: Scene, renderer: Any) -> tuple[Any, Any]:
    """Regions with samples of their own, marks within: Combined, and what tells its error."""
    assert renderer.prepare()
    assert renderer.render(0, 3)
    begins = np.full(4, 3, np.uint32)
    ends = np.array([3, 9, 6, 4], np.uint32)
    assert renderer.render_regions(begins, ends) and renderer.render_regions(ends, ends + np.uint32(2))
    return renderer.passes(), renderer.deviations()


def test_regions_take_the_samples_that_the_cpus_take(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plainly = plain()
    settings = replace(plainly.settings, samples=16, estimate_error=True)
    scene = replace(plainly, film=replace(plainly.film, passes=["Combined", "Sample Count"]), settings=settings)
    on_device = replace(scene, settings=replace(settings, device="CUDA"))
    monkeypatch.setattr(device_render, "MOST_PATHS", 96)  # of 280 pixels
    monkeypatch.setattr(device_render, "FEWEST_PATHS", 96)
    monkeypatch.setattr(several, "usable_devices", lambda: [0, 0])
    cpu, (_, deviation, share) = in_regions(scene, core.render.Renderer(scene))
    assert set(np.unique(cpu["Sample Count"])) == {5.0, 6.0, 8.0, 11.0}
    for renderer in (device_render.DeviceRenderer(on_device), several.SeveralDevices(on_device, [0, 0])):
        ours, (_, own_deviation, own_share) = in_regions(on_device, renderer)
        assert np.array_equal(cpu["Sample Count"], ours["Sample Count"])
        check_equal("Combined", cpu["Combined"], ours["Combined"], place)
        check_equal("deviation", deviation, own_deviation, place)
        assert share == pytest.approx(own_share)


@pytest.fixture
def two_gpus(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is one GPU it stands for both: two contexts of work on it, each with its film."""
    if place == FIBERS:
        monkeypatch.setattr(device.cupy().cuda.runtime, "getDeviceCount", lambda: 2)
    elif len(several.usable_devices()) < 2:
        monkeypatch.setattr(several, "usable_devices", lambda: [0, 0])


def test_two_gpus_share_the_samples_and_the_picture_is_the_same(place: str, two_gpus: None) -> None:
    passes = ["Combined", *FIRST_PASSES, *LIGHT_PASSES]
    scene = everything(device="CUDA", estimate_error=True)
    scene.film.passes, scene.settings.samples = passes, 7
    one, two = (render(replace(scene, settings=replace(scene.settings, gpus=count))) for count in (1, 0))
    assert two.stats["device"].startswith("CUDA: 2 x ")
    assert len(two.stats["samples_per_second_of_gpus"]) == 2
    for name in passes:
        np.testing.assert_allclose(two.passes[name], one.passes[name], rtol=1e-6, atol=1e-7, err_msg=name)
    assert two.stats["error"] == pytest.approx(one.stats["error"], rel=1e-6)
    for name in ("paths", "rays", "shadow_rays", "surface_points", "samples"):
        assert two.stats[name] == one.stats[name], name


def test_a_gpu_without_memory_is_left_out_and_named(
    place: str, two_gpus: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    allocate, calls = device_render.DeviceRenderer._allocate, []

    def full(self: device_render.DeviceRenderer, *wanted: Any) -> Any:
        calls.append(wanted)
        if len(calls) == 2:
            raise device.DeviceError("The GPU has 0 GiB free.")
        return allocate(self, *wanted)

    monkeypatch.setattr(device_render.DeviceRenderer, "_allocate", full)
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA"))
    result = render(scene)
    assert result.stats["device"].startswith("CUDA: 1 x ")
    assert result.stats["warnings"] == ["One GPU of 2 is left out: The GPU has 0 GiB free."]
    assert result.stats["samples"] == scene.settings.samples


def test_a_cancel_stops_every_gpu(place: str, two_gpus: None) -> None:
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA", samples=1 << 14))
    result = render(scene, progress=lambda progress: progress.samples == 0)
    assert result.cancelled
    assert 1 <= result.stats["samples"] < 1 << 14


@pytest.mark.parametrize(("count", "weights", "parts"), [(7, [1.0, 1.0], [4, 3]), (1, [1.0, 1.0], [0, 1]),
                                                         (100, [3.0, 1.0], [75, 25]), (0, [1.0, 1.0], [0, 0])])  # fmt: skip
def test_samples_are_shared_by_speed(count: int, weights: list[float], parts: list[int]) -> None:
    assert several.shares(count, weights) == parts


def checked() -> Scene:
    """plain(), the floor showing an image of each format."""
    scene, rng = plain(), np.random.default_rng(3)
    kinds = (np.uint8, np.float16, np.float32)
    scene.images = [
        Image(f"Image {k}", (rng.random((8 << k, 19, 4)) * (255 if k == 0 else 1)).astype(kind))
        for k, kind in enumerate(kinds)
    ]
    builder = ProgramBuilder()
    uvw = builder.op3("POINT_POSITION", (), (0, 0))
    for index in range(len(kinds)):
        color = builder.op("IMAGE", uvw, (builder.image(index), 0, 0, 0, 0))[:3]
        closure(builder, "CLOSURE_DIFFUSE", {"color": color}, weight=(0.3, 0.3, 0.3))
    scene.materials = [Material("Checks", builder.finish())]
    return replace(scene, settings=replace(scene.settings, device="CUDA"))


def test_images_that_do_not_fit_are_read_from_the_hosts_memory(place: str) -> None:
    scene = checked()
    whole = render(scene)
    small = replace(scene, settings=replace(scene.settings, texture_memory=1e-3))
    parts = render(small)
    assert np.array_equal(whole.passes["Combined"], parts.passes["Combined"])
    assert whole.stats["warnings"] == []
    assert parts.stats["warnings"] == ["2 images stay in the host's memory (0.0154 MB): the GPU's has no room, and reads them "
                                       "more slowly."]  # fmt: skip
    sizes = [image.pixels.nbytes // 19 * 24 for image in scene.images]  # filled up to whole tiles
    assert whole.stats["device_scene_bytes"] - parts.stats["device_scene_bytes"] == sum(sizes[1:])
    cpu = render(replace(scene, settings=replace(scene.settings, device="CPU")))
    check_equal("Combined", cpu.passes["Combined"], parts.passes["Combined"], place)
    assert cpu.passes["Combined"][..., :3].std() > 0.01, "the images are seen"


def test_a_scene_that_does_not_fit_is_told_before_it_is_uploaded(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device.cupy().cuda.runtime, "memGetInfo", lambda: (1000, 1 << 30))
    with pytest.raises(
        device.DeviceError, match=r"The scene takes 0\.0 GiB of the GPU's memory, of which 0\.0 are free"
    ):
        render(checked())


@pytest.mark.cuda
@pytest.mark.parametrize("effects", covering_rows(), ids=lambda row: f"{len(row)} effects")
def test_kernels_of_any_two_effects_draw_what_general_ones_do(place: str, effects: tuple[str, ...]) -> None:
    """On a GPU alone: fibers would be compiled for a quarter of an hour."""
    if place == FIBERS:
        pytest.skip("on a GPU alone")
    scene = scene_of(effects)
    lean = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    full = render(replace(scene, settings=replace(scene.settings, device="CUDA", force_effects=["ALL"])))
    for name, image in lean.passes.items():
        assert np.array_equal(image.view(np.uint32), full.passes[name].view(np.uint32)), name


@pytest.mark.cuda
@pytest.mark.parametrize(
    "number, effects",
    [*enumerate(covering_rows())],
    ids=lambda row: f"{len(row)} effects" if isinstance(row, tuple) else "",
)
def test_kernels_compiled_ahead_of_time_draw_what_the_scenes_own_do(
    place: str, number: int, effects: tuple[str, ...]
) -> None:
    """Which interpret programs, and hold all that any scene may need."""
    if place == FIBERS:
        pytest.skip("on a GPU alone: nvcc's machine code is held against NVRTC's, and fibers run neither")
    architecture = device.architecture_of(device.cupy())
    if compiler.ahead_file(STAGES, "WATERTIGHT", architecture, compiler.ready_made(STAGES)[0]) is None:
        # Only with them in place, which the other tests must not have: scenes this small would end before their own
        # kernels are there. tests/bench/records/cuda-tests.json says when it ran.
        pytest.skip("build.py build --cuda was not run")
    scene = scene_of(effects)
    scene.settings.device, scene.settings.sampler = "CUDA", samplers.NAMES[number % len(samplers.NAMES)]
    with pytest.MonkeyPatch.context() as apart:
        apart.setattr(compiler, "ready_made", lambda module: [("-DLUCH_NEVER_COMPILED=1",)])
        own = render(scene)
    general = render(replace(scene, settings=replace(scene.settings, own_kernels=False)))
    assert (own.stats["kernels"], general.stats["kernels"]) == ("the scene's own", "general")
    for name, image in own.passes.items():
        assert np.array_equal(image.view(np.uint32), general.passes[name].view(np.uint32)), name


@pytest.mark.parametrize("sampler", ["LATTICE", pytest.param("INDEPENDENT", marks=pytest.mark.cuda)])
def test_kernels_draw_the_numbers_of_the_family_that_was_asked_for(place: str, sampler: str) -> None:
    if place == FIBERS and sampler == "INDEPENDENT":
        pytest.skip("on a GPU alone: LATTICE shows the way of a family, and a second would be compiled for fibers")
    scene = replace(plain(), settings=replace(plain().settings, sampler=sampler))
    cpu, _, ours, stats = both(scene)
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert stats["kernel_plan"]["SAMPLER"] > 0
    other = render(replace(scene, settings=replace(scene.settings, sampler="SOBOL")))
    assert not np.array_equal(cpu["Combined"], other.passes["Combined"])

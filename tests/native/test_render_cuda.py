"""The wavefront of CUDA against the CPU's renderer: the same paths, so the same picture but for the order of sums.

On fibers (tests/support/cuda_on_cpu.py) always; on a GPU with `-m cuda`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.cuda import device
from luch.cuda import render as device_render
from luch.render import Progress, render
from luch.scene import Camera, Film, Instances, Light, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder
from support.cuda_on_cpu import FIBERS
from support.effects import closure, principled, program

LIGHT_PASSES = ["Emission", "Environment", "Ambient Occlusion", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color",
                "Glossy Direct", "Glossy Indirect", "Glossy Color", "Transmission Direct", "Transmission Indirect",
                "Transmission Color"]  # fmt: skip
FIRST_PASSES = ["Depth", "Position", "Object Index", "Material Index"]
DATA_PASSES = ["Mist", "Normal", "UV", "Denoising Albedo", "Denoising Normal", "CryptoObject00", "CryptoMaterial00"]


def quad(name: str, half: float, z: float) -> Mesh:
    """A square that faces up."""
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], np.float32)
    return Mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.zeros(2, np.uint16))


def stone(builder: ProgramBuilder) -> None:
    principled(builder, base_color=(0.6, 0.5, 0.4), roughness=0.4, coat_weight=0.3)


def glass(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_GLASS", {"color": (0.9, 1.0, 0.9), "roughness": 0.1, "ior": 1.4})


def leaf(builder: ProgramBuilder) -> None:
    """Half there."""
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.2, 0.6, 0.1)}, weight=(0.5, 0.5, 0.5))
    closure(builder, "CLOSURE_TRANSPARENT", {"color": (1.0, 1.0, 1.0)}, weight=(0.5, 0.5, 0.5))


def glow(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_EMISSION", {"color": (1.0, 0.7, 0.4), "strength": 6.0})


def sky(builder: ProgramBuilder) -> None:
    """Brighter where the direction's z is higher: a program that must run for each ray."""
    up = builder.op3("POINT_POSITION", (), (0, 0))[2]
    closure(builder, "CLOSURE_EMISSION", {"color": (0.3, 0.5, 0.9), "strength": up})


def everything(**settings: Any) -> Scene:
    """Floor, glass pane, two half transparent leaves (instances, one turned), a glowing square, lamps of each kind."""
    turned = np.array([[0.8, -0.6, 0, 1.0], [0.6, 0.8, 0.0, -0.5], [0.0, 0.1, 1.2, 0.4]])
    places = [np.eye(3, 4) for _ in range(4)] + [turned]
    count = len(places)
    instances = Instances(
        np.array([0, 1, 2, 3, 2], np.uint32), np.stack(places), np.linspace(0, 1, count, dtype=np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip

    def at(x: float, y: float, z: float) -> Any:
        return np.array([[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z]])

    return Scene(
        meshes=[quad("Floor", 4.0, 0.0), quad("Pane", 0.8, 1.5), quad("Leaf", 0.7, 2.0), quad("Panel", 0.5, 3.0)],
        objects=[Object("Floor", 0, [0]), Object("Pane", 1, [1]), Object("Leaf", 2, [2]), Object("Panel", 3, [3])],
        instances=instances,
        materials=[Material("Stone", program(stone)), Material("Glass", program(glass)),
                   Material("Leaf", program(leaf)), Material("Glow", program(glow))],
        lights=[Light("Bulb", "POINT", matrix=at(1.0, 0.5, 4.0), power=300.0, radius=0.3),
                Light("Window", "AREA", matrix=at(-1.5, 0.0, 3.5), power=60.0, size=1.0),
                Light("Sun", "SUN", matrix=at(0, 0, 5.0), power=1.5, angle=0.2)],
        world=World("Sky", program(sky), map_resolution=32),
        camera=Camera(matrix=at(0.2, 0.1, 6.0), lens_mm=36.0, fstop=2.0, focus_distance=5.0, use_dof=True),
        film=Film(width=20, height=14),
        settings=Settings(samples=4, accelerator="BVH", threads=1, **settings),
    )  # fmt: skip


def both(scene: Scene) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Passes and statistics, CPU's and CUDA's."""
    ours = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    cpu = render(scene)
    return cpu.passes, cpu.stats, ours.passes, ours.stats


def check_equal(name: str, cpu: Any, ours: Any, place: str) -> None:
    """fibers: but for the order of double sums. GPU: a few of its functions differ in the last bit, so a path may turn."""
    assert np.isfinite(ours).all(), name
    if place == FIBERS:
        np.testing.assert_allclose(ours, cpu, rtol=2e-6, atol=1e-7, err_msg=name)
        return
    differ = ~np.isclose(ours, cpu, rtol=1e-4, atol=1e-5)
    assert differ.mean() < 0.01, (name, differ.mean())


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


def plain() -> Scene:
    """A floor under one lamp: nothing else."""
    scene = everything(max_bounces=2)
    instances = scene.instances
    assert instances is not None
    one = Instances(*(getattr(instances, name)[:1] for name in ("object", "matrix", "random", "generated", "uv")))
    return replace(scene, meshes=scene.meshes[:1], objects=scene.objects[:1], instances=one, lights=scene.lights[:1],
                   materials=[Material("Chalk", program(chalk))], world=None)  # fmt: skip


def chalk(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.6, 0.5, 0.4)})


def test_code_for_what_the_scene_lacks_changes_no_bit(place: str) -> None:
    scene = plain()
    everything_compiled = replace(scene, settings=replace(scene.settings, device="CUDA", compile_only_needed=False))
    full = render(everything_compiled)
    lean = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert np.array_equal(full.passes["Combined"], lean.passes["Combined"])
    assert lean.passes["Combined"][..., :3].max() > 0.1
    absent = {name for name, needed in lean.stats["kernel_plan"].items() if not needed}
    assert absent >= {"THIN_FILM", "MICROFACETS", "SUNS", "EMISSIVE_MESHES", "WORLD_SAMPLING", "LIGHT_PASSES", "SHEEN"}
    assert lean.stats["kernel_plan"]["LAMPS"]


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


def test_too_little_memory_is_told_with_its_remedy(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(plain(), settings=replace(plain().settings, device="CUDA"))
    monkeypatch.setattr(device_render, "MEMORY_SHARE", 1e-9)
    with pytest.raises(device.DeviceError, match=r"GiB free; the film of this picture and .* paths need more"):
        render(scene)

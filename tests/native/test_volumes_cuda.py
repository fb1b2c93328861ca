"""Volumes in the wavefront of CUDA: the CPU's picture. On fibers always, on a GPU with `-m cuda`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.render import render
from luch.scene import Camera, Material, Medium, Phase, Scene
from support.devices import both, check_equal, watch_shadows
from support.effects import program
from support.everything import everything, glass
from support.media import at, box, even, fog

PASSES = ["Combined", "Volume Direct", "Volume Indirect", "Diffuse Direct", "Diffuse Indirect", "Emission",
          "Environment", "Denoising Albedo", "Ambient Occlusion"]  # fmt: skip


def misty(**settings: Any) -> Scene:
    """Everything, in fog: around all, in a box that the camera is in, in a smaller one of glass."""
    scene = everything(**{"max_bounces": 6, "volume_bounces": 3, **settings})
    instances = scene.instances
    assert instances is not None and scene.world is not None
    boxes = [box("Room", (3.5, 3.5, 3.6), (0.0, 0.0, 3.4)), box("Block", (0.5, 0.6, 0.4), (0.2, -1.0, 1.0))]
    haze = Medium((0.02, 0.05, 0.01), (0.01, 0.0, 0.02), [even((0.1, 0.05, 0.2), 0.6)])
    tar = Medium((1.0, 0.2, 0.4), scattering=[Phase("DRAINE", (0.5, 0.5, 0.5), -0.4, 2.0)])
    count = len(scene.objects)
    first = {"object": 2, "matrix": 2, "random": 2, "generated": 2, "uv": 2}
    more = {name: getattr(instances, name)[:rows].copy() for name, rows in first.items()}
    more["object"][:] = count, count + 1
    more["matrix"][:] = at(0, 0, 0)
    joined = {name: np.concatenate([getattr(instances, name), more[name]]) for name in first}
    return replace(
        scene,
        meshes=scene.meshes + boxes,
        objects=[*scene.objects, *(replace(scene.objects[0], name=mesh.name, mesh=4 + k, materials=[4 + k])
                                   for k, mesh in enumerate(boxes))],
        instances=replace(instances, **joined),
        materials=[*scene.materials, fog(haze), Material("Tar", program(glass), volume=tar)],
        world=replace(scene.world, volume=Medium((0.001, 0.001, 0.002), scattering=[even((0.01, 0.01, 0.01))])),
    )  # fmt: skip


@pytest.mark.parametrize("camera", ["lens", "wide"])
def test_a_misty_picture_is_the_cpus(place: str, camera: str) -> None:
    scene = misty()
    if camera == "wide":  # rays begin inside and outside of the box
        scene = replace(scene, camera=Camera("ORTHO", at(0.0, 0.0, 6.0), ortho_scale=9.0))
    cpu, cpu_stats, ours, stats = both(replace(scene, film=replace(scene.film, passes=PASSES)))
    for name in PASSES:
        check_equal(name, cpu[name], ours[name], place)
    assert cpu["Volume Direct"].mean() > 1e-4
    assert cpu["Volume Indirect"].mean() > 1e-4
    assert stats["kernel_plan"]["VOLUMES"]
    for name in ("rays", "shadow_rays", "flights", "transparent_steps"):
        assert stats[name] == pytest.approx(cpu_stats[name], rel=0.01)


def test_a_scene_without_volumes_has_no_code_for_them(place: str) -> None:
    _, _, _, stats = both(everything())
    assert not stats["kernel_plan"]["VOLUMES"]
    assert stats["flights"] == 0


def test_a_path_adds_light_of_its_flight_and_of_its_surface_one_after_the_other(
    place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = watch_shadows(monkeypatch)
    stats = render(replace(misty(), settings=replace(misty().settings, device="CUDA"))).stats
    assert stats["flights"] > 0
    assert sum(watched) > 100

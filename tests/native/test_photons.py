"""Photon maps: the same picture on every device and in any steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from luch._native import core
from luch.cuda import photons
from luch.render import render
from luch.scene import Film, Light, Material
from support.devices import both, check_equal
from support.effects import program
from support.everything import everything
from support.hard_scenes import picture
from support.through_glass import glass, scene_through_glass

PASSES = ["Combined", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color", "Transmission Direct",
          "Transmission Indirect", "Transmission Color"]  # fmt: skip


def test_threads_and_steps_change_no_bit() -> None:
    scene = scene_through_glass(samples=40)
    whole = picture(scene)
    np.testing.assert_array_equal(whole, picture(replace(scene, settings=replace(scene.settings, threads=3))))
    renderer = core.render.Renderer(scene)
    assert renderer.prepare()
    done = 0
    for count in (1, 2, 2, 3, 9, 20, 3):
        assert renderer.render(done, count)
        done += count
    np.testing.assert_array_equal(whole, renderer.passes()["Combined"][..., :3])


def test_a_scene_without_caustics_is_drawn_by_paths_bit_for_bit() -> None:
    rough = scene_through_glass(samples=4)
    rough.materials[1] = Material("Rough", program(lambda b: glass(b, 0.6)))
    rough.lights = [Light("Lamp", "AREA", matrix=np.eye(3, 4) + np.eye(3, 4, 3)[::-1], power=40.0)]
    traced = render(rough)
    assert traced.stats["photons"] == 0
    path = replace(rough, settings=replace(rough.settings, integrator="PATH"))
    np.testing.assert_array_equal(traced.passes["Combined"], render(path).passes["Combined"])


def test_maps_part_where_the_film_does_and_serve_every_sample_once() -> None:
    sample, firsts = 0, []
    while sample < 200:
        count = core.photons.samples_of_map(sample, 1 << 20)
        firsts.append(sample)
        assert 0 < count <= core.photons.MOST_SAMPLES_OF_MAP
        assert {core.photons.first_of_map(sample + k) for k in range(count)} == {sample}
        assert core.photons.samples_of_map(sample + count - 1, 100) == 1
        sample += count
    assert {1 << k for k in range(8)} <= set(firsts)


def test_the_picture_is_the_cpus(place: str) -> None:
    scene = scene_through_glass(samples=3)
    scene.film = Film(width=8, height=8, passes=PASSES, lightgroups=["key"])
    scene.lights[0].lightgroup = "key"
    cpu, cpu_stats, ours, stats = both(scene)
    for name in cpu:
        check_equal(name, cpu[name], ours[name], place)
    assert cpu["Transmission Indirect"].max() > 0.0 == cpu["Transmission Direct"].max()  # seen through the sheet
    assert stats["photons"] == cpu_stats["photons"] and stats["photon_maps"] == cpu_stats["photon_maps"] == 3
    assert stats["photons_landed"] == pytest.approx(cpu_stats["photons_landed"], rel=1e-3)
    assert stats["photon_map_bytes"] > 64 * 1000 < cpu_stats["photon_map_bytes"]
    assert stats["kernel_plan"]["PHOTONS"] and stats["kernels"] == "the scene's own"


def test_a_scene_of_everything_is_the_cpus_with_photons(place: str) -> None:
    cpu, cpu_stats, ours, _ = both(everything(integrator="PHOTON"))
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert cpu_stats["photons"] > 0


def test_more_photons_than_there_is_room_for_are_traced_again(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_through_glass(samples=1, size=4)
    monkeypatch.setattr(photons, "RECORDS", 0.05)
    cpu, cpu_stats, ours, stats = both(scene)
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    assert stats["photons_landed"] == pytest.approx(cpu_stats["photons_landed"], rel=1e-3)

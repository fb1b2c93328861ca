"""Renders of what moves: against what a shutter must see, and against what stands still."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.effects import effects_of
from luch.effects.removal import without
from luch.render import render
from luch.scene import (
    InstanceMotion,
    Instances,
    Material,
    Mesh,
    Object,
    Settings,
    Shutter,
)
from luch.scenefile import read_scene, write_scene
from support.effects import closure, program
from support.everything import everything, quad
from support.moving_square import (
    EVEN,
    WAYS,
    expected,
    glow,
    moved_camera,
    moved_object,
    moved_shape,
    row,
    shifted,
    square,
)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_a_square_that_moves_covers_each_pixel_for_its_time(way: str, speed: float) -> None:
    np.testing.assert_allclose(row(WAYS[way](square(), speed, 3)), expected(speed, EVEN), atol=0.005)


def test_the_shutters_curve_weighs_the_times() -> None:
    scene = moved_object(square(), 4.0)
    assert scene.shutter is not None
    opening = replace(scene, shutter=replace(scene.shutter, curve=np.linspace(0.0, 1.0, 256, dtype=np.float32)))
    np.testing.assert_allclose(row(opening), expected(4.0, np.sqrt(EVEN)), atol=0.005)


def test_what_moves_together_with_the_camera_is_sharp() -> None:
    scene = moved_object(moved_camera(square(), -3.0), 3.0)
    np.testing.assert_allclose(row(scene), expected(0.0, [0.5]), atol=1e-6)


def test_a_square_that_sways_is_seen_at_all_its_keys() -> None:
    scene = square()
    assert scene.instances is not None
    places = np.stack([shifted(x) for x in (-2.0, 2.0, -2.0)])
    motion = InstanceMotion(np.zeros(1, np.uint32), np.array([3], np.uint32), places)
    scene = replace(scene, instances=replace(scene.instances, motion=motion))
    np.testing.assert_allclose(row(scene), expected(4.0, EVEN), atol=0.005)


def test_a_shutter_over_a_still_scene_costs_nothing() -> None:
    still = replace(everything(), shutter=None)
    opened = replace(everything(), shutter=Shutter())
    a, b = render(still), render(opened)
    assert np.array_equal(a.passes["Combined"], b.passes["Combined"])
    assert b.stats["time_samples"] == 0
    for name in ("scene_bytes", "structure_bytes", "rays", "shadow_rays"):
        assert a.stats[name] == b.stats[name], name
    for name in ("camera motion", "object motion", "deformation motion"):
        assert not effects_of(opened)[name].on
        assert "0.5 frames" in effects_of(opened)[name].reason
        assert effects_of(still)[name].reason == "the scene asks for no motion blur"


@pytest.mark.parametrize("way", WAYS)
def test_a_path_draws_one_time_where_something_moves(way: str) -> None:
    scene = WAYS[way](replace(square(), settings=Settings(samples=4, threads=1)), 1.0)
    name = {"object": "object motion", "shape": "deformation motion", "camera": "camera motion"}[way]
    assert [n for n in ("object motion", "deformation motion", "camera motion") if effects_of(scene)[n].on] == [name]
    stats = render(scene).stats
    assert stats["time_samples"] == stats["paths"]
    still = without(scene, [name])
    assert not effects_of(still)[name].on
    assert render(still).stats["time_samples"] == 0
    assert np.array_equal(row(still), row(replace(square(), shutter=None, settings=scene.settings)))


def test_keys_that_are_all_alike_are_no_motion() -> None:
    scene = moved_object(everything(), 0.0)
    stats = render(scene).stats
    assert stats["time_samples"] == 0


def test_what_is_told_to_stand_still_is_told() -> None:
    shutter = Shutter(still=['object "Car": its Motion Blur is disabled', "the camera's Motion Blur is disabled"])
    effects = effects_of(replace(square(), shutter=shutter))
    assert effects["object motion"].reason == 'object "Car": its Motion Blur is disabled'
    assert effects["camera motion"].reason == "the camera's Motion Blur is disabled"


def test_a_scene_file_keeps_what_moves(tmp_path: Any) -> None:
    scene = moved_camera(moved_shape(moved_object(square(), 2.0, 3), 1.0, 5), 0.5)
    write_scene(scene, tmp_path / "moving.luch")
    again = read_scene(tmp_path / "moving.luch")
    assert again.instances is not None and again.instances.motion is not None
    assert again.shutter == scene.shutter
    assert np.array_equal(again.meshes[0].motion_positions, scene.meshes[0].motion_positions)
    assert np.array_equal(render(again).passes["Combined"], render(scene).passes["Combined"])


def test_shapes_that_do_not_fit_are_refused_by_name() -> None:
    scene = square()
    scene.meshes[0].motion_positions = np.zeros((2, 7, 3), np.float32)
    with pytest.raises(ValueError, match=r'Mesh "Square": motion_positions must be \(K, V, 3\)'):
        render(scene)


def test_light_of_a_panel_that_moves_is_the_same_sampled_or_met() -> None:
    """Sampled at the path's time, wherever the panel is then: else the two ways would disagree."""

    def floor(builder: Any) -> None:
        closure(builder, "CLOSURE_DIFFUSE", {"color": (0.8, 0.8, 0.8)})

    panel, ground = quad("Panel", 0.5, 1.0), quad("Ground", 4.0, 0.0)
    panel = Mesh(panel.name, panel.positions, panel.triangles[:, ::-1].copy(), panel.material_slots)
    scene = replace(
        square(diffuse_bounces=0),
        meshes=[panel, ground],
        objects=[Object("Panel", 0, [0], visibility=62), Object("Ground", 1, [1])],
        materials=[Material("Glow", program(glow)), Material("Chalk", program(floor))],
    )
    assert scene.instances is not None
    scene.instances = Instances(np.arange(2, dtype=np.uint32), np.stack([shifted(0.0)] * 2), np.zeros(2, np.float32),
                                np.zeros((2, 3), np.float32), np.zeros((2, 2), np.float32))  # fmt: skip
    moving = moved_object(scene, 5.0, 3)
    unsampled = [replace(scene.materials[0], emission_sampling="NONE"), scene.materials[1]]
    sampled, met = (row(s).reshape(-1, 8).mean(axis=1) for s in (moving, replace(moving, materials=unsampled)))
    assert sampled.max() > 0.02
    np.testing.assert_allclose(sampled, met, atol=0.03 * sampled.max())

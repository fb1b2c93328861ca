"""Hair that changes its shape while the shutter is open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.effects import effects_of
from luch.render import Result, render
from luch.scene import InstanceMotion, Scene, Shutter
from luch.scenefile import read_scene, write_scene
from support.cuda_on_cpu import FIBERS
from support.effects import closure
from support.hair import fibre, fur, scene_of, strands

SHAPES = ("RIBBON", "THICK", "THICK_LINEAR")
SHIFT = np.array([[0.4, 0.1, -0.2], [0.0, 0.0, 0.0], [-0.3, 0.2, 0.1]], np.float32)  # at three keys


def glow(builder: Any) -> None:
    closure(builder, "CLOSURE_EMISSION", {"color": (1.0, 1.0, 1.0), "strength": 1.0})


def blurred(scene: Scene, samples: int = 64) -> Scene:
    scene.shutter = Shutter()
    scene.settings.samples = samples
    scene.film.passes = ["Combined"]
    return scene


def rendered(scene: Scene) -> Result:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    return result


def shifted(shape: str, as_object: bool) -> Scene:
    """The same way, of the points or of their object."""
    scene = blurred(scene_of(fur(40, radius=0.1), fibre, shape=shape, world=1.0, size=16))
    curves = scene.meshes[0].curves
    assert curves is not None and scene.instances is not None
    if as_object:
        matrices = np.repeat(np.eye(3, 4)[None], len(SHIFT), axis=0)
        matrices[:, :, 3] = SHIFT
        count = np.array([len(SHIFT)], np.uint32)
        scene.instances.motion = InstanceMotion(np.zeros(1, np.uint32), count, matrices)
    else:
        curves.motion_points = np.repeat(curves.points[None], len(SHIFT), axis=0)
        curves.motion_points[..., :3] += SHIFT[:, None]
    return scene


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", ["BVH", "KD_TREE"])
def test_points_that_move_together_look_as_an_object_that_does(shape: str, kind: str) -> None:
    scene, other = shifted(shape, False), shifted(shape, True)
    scene.settings.accelerator = other.settings.accelerator = kind
    assert effects_of(scene)["deformation motion"].on and effects_of(other)["object motion"].on
    ours, truth = rendered(scene).passes["Combined"], rendered(other).passes["Combined"]
    still = rendered(replace(scene, shutter=None)).passes["Combined"]
    assert np.abs(still - truth).max() > 0.1
    # They round otherwise, and so a path may turn now and then.
    assert np.isclose(ours, truth, atol=1e-4).mean() > 0.85
    assert np.abs(ours - truth).max() < 0.12
    np.testing.assert_allclose(ours.mean((0, 1)), truth.mean((0, 1)), atol=2e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_hair_that_grows_thicker_covers_each_pixel_for_its_time(shape: str) -> None:
    scene = blurred(scene_of(strands([[-9, 0, 0, 0.5], [9, 0, 0, 0.5]]), glow, shape=shape, width=3.0, size=24), 256)
    curves = scene.meshes[0].curves
    assert curves is not None
    curves.motion_points = np.stack([curves.points, curves.points])
    curves.motion_points[0, :, 3], curves.motion_points[1, :, 3] = 0.25, 1.25
    seen = rendered(scene).passes["Combined"][:, 12, 0]
    away = np.abs((np.arange(24) + 0.5) / 24 * 3.0 - 1.5)
    np.testing.assert_allclose(seen, np.clip(1.25 - away, 0.0, 1.0), atol=0.02)


def test_hair_that_keeps_its_shape_costs_what_still_hair_costs() -> None:
    scene = shifted("RIBBON", False)
    plain, curves = rendered(replace(scene, shutter=None)), scene.meshes[0].curves
    assert curves is not None
    curves.motion_points = None
    still = rendered(scene)
    assert np.array_equal(plain.passes["Combined"], still.passes["Combined"])
    assert plain.stats["structure_bytes"] == still.stats["structure_bytes"]


def test_points_that_are_not_finite_at_some_key_are_left_out() -> None:
    scene = shifted("RIBBON", False)
    curves = scene.meshes[0].curves
    assert curves is not None and curves.motion_points is not None
    before = rendered(scene).stats["dropped_curve_pieces"]
    curves.motion_points[2, 40] = np.nan  # the first point of the ninth strand: of its own segment and the next
    assert rendered(scene).stats["dropped_curve_pieces"] == before + 2 * 4


def test_points_that_do_not_fit_are_refused_by_name() -> None:
    scene = shifted("RIBBON", False)
    curves = scene.meshes[0].curves
    assert curves is not None and curves.motion_points is not None
    curves.motion_points = curves.motion_points[:, 1:]
    with pytest.raises(ValueError, match=r'Mesh "Fur": motion_points of its curves must be \(K, P, 4\)'):
        render(scene)


def test_a_scene_file_keeps_hair_that_moves(tmp_path: Any) -> None:
    scene = shifted("RIBBON", False)
    write_scene(scene, tmp_path / "fur.luch")
    curves, kept = scene.meshes[0].curves, read_scene(tmp_path / "fur.luch").meshes[0].curves
    assert curves is not None and kept is not None and kept.motion_points is not None
    assert np.array_equal(kept.motion_points, curves.motion_points)


@pytest.mark.cuda
def test_the_picture_of_hair_that_moves_is_the_cpus(place: str) -> None:
    """On fibers by hand (-m cuda -k fibers): one kernel more to compile than test_curves_cuda.py does."""
    scene = shifted("RIBBON", False)
    scene.settings.samples, scene.film.width, scene.film.height = 2, 10, 10
    ours = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    cpu = rendered(scene)
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    assert ours.stats["kernel_plan"]["CURVES"] and ours.stats["kernel_plan"]["MOTION"]
    a, b = ours.passes["Combined"], cpu.passes["Combined"]
    if place == FIBERS:
        np.testing.assert_allclose(a, b, rtol=2e-6, atol=1e-7)
    else:  # a few of a GPU's functions differ in the last bit, so a path may turn
        assert (~np.isclose(a, b, rtol=1e-4, atol=1e-5)).mean() < 0.02

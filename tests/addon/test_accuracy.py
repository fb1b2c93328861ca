"""What a render says of its own error, against a render with many more samples."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Scene
from support.pictures import rel_mse

from addon.engine import capture_scene

SIZE = 32
REFERENCE_SAMPLES = 2048


@pytest.fixture
def exported(scene: bpy.types.Scene) -> Scene:
    """A ball and a cube on a floor under a lamp and a grey sky."""
    bpy.ops.mesh.primitive_plane_add(size=12)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(-1, 0, 1))
    bpy.ops.mesh.primitive_cube_add(location=(1.6, 0.5, 0.8), size=1.6)
    bpy.ops.object.light_add(type="AREA", location=(2, -3, 5), rotation=(0.6, 0.3, 0))
    bpy.context.object.data.energy = 300
    bpy.ops.object.camera_add(location=(0, -7, 3), rotation=(1.25, 0, 0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("Grey")
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    found = capture_scene(scene, bpy.context.view_layer)
    found.settings.accelerator = "BVH"
    found.settings.max_bounces = 2
    return found


def shoot(scene: Scene, samples: int, seed: int = 0, threads: int = 0, halves: bool = True) -> Result:
    settings = scene.settings
    settings.samples, settings.seed, settings.threads, settings.estimate_error = samples, seed, threads, halves
    return render(scene)


def test_renders_know_their_error(exported: Scene) -> None:
    reference = shoot(exported, REFERENCE_SAMPLES, 1000).passes["Combined"]
    covered, ratios = [], []
    for samples, seeds in ((32, 8), (72, 8)):
        for seed in range(seeds):
            result = shoot(exported, samples, seed)
            stats = result.stats
            error = np.sqrt(rel_mse(result.passes["Combined"], reference))
            covered.append(stats["error_low"] <= error <= stats["error_high"])
            ratios.append((stats["error"] / error) ** 2)
            assert stats["brightness_low"] < stats["brightness"] < stats["brightness_high"]
    assert np.mean(covered) >= 0.75  # 16 renders, and a reference with noise of its own
    # A thousand pixels, a few of which carry most of the noise: single pictures scatter by a fifth.
    assert 0.85 < np.median(ratios) < 1.18 and np.mean([0.8 <= ratio <= 1.25 for ratio in ratios]) >= 0.6


def test_the_estimate_changes_no_pixel(exported: Scene) -> None:
    without, known = (shoot(exported, 8, halves=halves) for halves in (False, True))
    assert "error" not in without.stats and 0.0 < known.stats["error_low"] < known.stats["error"]
    assert "error" not in shoot(exported, 1).stats, "one sample has no other part"
    assert list(known.passes) == list(without.passes)
    assert without.passes["Combined"].tobytes() == known.passes["Combined"].tobytes()


def test_a_render_ends_at_the_error_asked_for(exported: Scene) -> None:
    reference = shoot(exported, REFERENCE_SAMPLES, 1000).passes["Combined"]
    exported.settings.error_limit = 0.04
    met = []
    for seed in range(6):
        result = shoot(exported, 4096, seed)
        assert result.stats["stopped_by"] == "error" and result.stats["error"] <= 0.04
        assert 16 <= result.stats["samples"] < 512
        met.append(0.7 <= np.sqrt(rel_mse(result.passes["Combined"], reference)) / 0.04 <= 1.1)
    assert np.mean(met) >= 0.8  # of 6
    exported.settings.error_limit = 1e-5
    assert shoot(exported, 32).stats["stopped_by"] == "samples"


def test_the_error_does_not_depend_on_threads(exported: Scene) -> None:
    one, many = (shoot(exported, 12, threads=threads) for threads in (1, 3))
    assert one.passes["Combined"].tobytes() == many.passes["Combined"].tobytes()
    assert one.stats["error"] == many.stats["error"]
    assert one.stats["error_curve"][-1][:3:2] == [12, one.stats["error"]]
    assert one.stats["next_error"] < one.stats["error"] and one.stats["seconds_to_next_error"] > 0.0


def test_the_error_pass_covers_the_reference_pixel_by_pixel(exported: Scene) -> None:
    reference = shoot(exported, REFERENCE_SAMPLES, 1000).passes["Combined"][..., :3]
    plain = shoot(exported, 32)
    exported.film.passes = [*exported.film.passes, "Error"]
    result = shoot(exported, 32, halves=False)  # the pass asks for the halves by itself
    assert np.array_equal(result.passes["Combined"], plain.passes["Combined"])
    error = result.passes["Error"]
    assert error.shape == (SIZE, SIZE, 3) and error.dtype == np.float32
    assert 0.9 <= np.mean(np.abs(result.passes["Combined"][..., :3] - reference) <= 1.96 * error) <= 0.995
    assert (shoot(exported, 1).passes["Error"] == 1e10).all(), "unknown"

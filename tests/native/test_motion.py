"""What a ray hits at a time is what it hits in the scene as it is at that time, traced still: the same bits."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from luch import core
from luch.accel import STRUCTURES
from luch.cuda.trace import SceneTracer
from luch.render import render
from luch.scene import CameraMotion, InstanceMotion, Shutter
from luch.scene import Scene as LuchScene
from support.accel_meshes import random_rays
from support.cuda_on_cpu import FIBERS
from support.everything import everything
from support.instances import NO_KINDS, Scene
from support.moving import NO_TIMES, TIMES, Moving, rotation, same


@pytest.mark.parametrize("kind", ["BVH", *STRUCTURES])
@pytest.mark.parametrize("for_device", [False, True])
def test_hits_at_a_time_are_those_of_the_scene_frozen_then(kind: str, for_device: bool) -> None:
    scene = Moving()
    accel = scene.build(kind, for_device=for_device)
    rays = random_rays(800, scale=4.0)
    met = set()
    for time in TIMES:
        times = np.full(len(rays), time, np.float32)
        truth = scene.frozen(float(time)).closest(rays, NO_KINDS)
        same(accel.closest(rays, NO_KINDS, times), truth)
        assert np.array_equal(accel.any(rays, NO_KINDS, times), scene.frozen(float(time)).any(rays, NO_KINDS))
        met |= set(truth[4].tolist())
    assert met >= {0, 1, 2, 3, 4, 5}


def test_rays_of_one_queue_have_times_of_their_own() -> None:
    scene = Moving()
    accel, rays = scene.build(), random_rays(2000, scale=4.0)
    times = TIMES[np.arange(len(rays)) % len(TIMES)]
    hits = accel.closest(rays, NO_KINDS, times)
    for time in TIMES:
        chosen = times == time
        same([part[chosen] for part in hits], scene.frozen(float(time)).closest(rays[chosen], NO_KINDS))


def test_without_times_all_is_seen_in_the_shutters_middle() -> None:
    scene = Moving()
    rays = random_rays(500, scale=4.0)
    same(scene.build().closest(rays, NO_KINDS, NO_TIMES), scene.frozen(0.5).closest(rays, NO_KINDS))


def test_what_stands_still_is_found_as_if_nothing_moved() -> None:
    """One tree in the world for all that is still, whatever else moves beside it: the same hits, and no more bytes."""
    scene = Moving()
    for_still = Scene(scene.still.meshes, [i for k, i in enumerate(scene.still.instances) if k in (1, 2, 5)])
    alone = for_still.build("BVH", 10_000_000)
    moving = Moving()
    moving.still.instances = [*for_still.instances, scene.still.instances[0]]
    moving.ways, moving.shapes = [(3, scene.ways[0][1])], []
    accel = moving.build(flatten=10_000_000)
    rays = random_rays(2000, scale=4.0)
    truth = alone.closest(rays, NO_KINDS)
    hits = accel.closest(rays, NO_KINDS, np.full(len(rays), 0.3, np.float32))
    unmoved = hits[4] != 3
    assert 0 < (~unmoved).sum() < len(rays)
    same([part[unmoved] for part in hits], [part[unmoved] for part in truth])


def test_a_scene_in_which_nothing_moves_has_no_more_bytes() -> None:
    scene = Moving()
    scene.ways, scene.shapes = [], []
    assert scene.build().bytes() == scene.still.build().stats()["bytes"]
    assert scene.build(for_device=True).bytes() == scene.still.trees().stats()["bytes"]


@pytest.mark.parametrize("flatten", [0, 10_000_000])
@pytest.mark.parametrize("kind", ["CWBVH", "BVH2"])
def test_kernels_give_the_hits_of_the_cpu(place: str, kind: str, flatten: int) -> None:
    """With flatten what stands still lies apart in the world, and what moves is looked for after it."""
    scene = Moving()
    trees = scene.build(kind, for_device=True, flatten=flatten)
    assert trees.has_world_apart() == (flatten > 0)
    tracer = SceneTracer(*trees.device_image(), kind, "WATERTIGHT", trees.has_world_apart(), moves=True)
    rays = random_rays(200, scale=4.0)
    times = TIMES[np.arange(len(rays)) % len(TIMES)]
    hits = tracer.closest_of(rays, None, times=times)
    truth = scene.build(flatten=flatten).closest(rays, NO_KINDS, times)
    same([hits[name] for name in ("t", "prim", "u", "v", "instance")], truth)
    assert np.array_equal(
        tracer.any_of(rays, None, times=times), scene.build(flatten=flatten).any(rays, NO_KINDS, times)
    )


def test_a_transform_between_keys_turns_evenly_on_the_short_way() -> None:
    keys = [np.hstack([rotation(2, angle), [[x], [0.0], [0.0]]]) for angle, x in ((0.2, 0.0), (0.2 + 2.0, 3.0))]
    for time in (0.0, 0.25, 0.5, 0.9, 1.0):
        to_world, to_object = core.motion.place(np.array(keys), time)
        expected = np.hstack([rotation(2, 0.2 + 2.0 * time), [[3.0 * time], [0.0], [0.0]]])
        np.testing.assert_allclose(to_world, expected, atol=2e-6)
        np.testing.assert_allclose(to_world[:, :3] @ to_object[:, :3], np.eye(3), atol=1e-6)


def test_a_key_is_met_exactly_whatever_its_matrix() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        keys = rng.normal(size=(3, 3, 4)) * rng.uniform(0.1, 10)
        for k in range(3):
            to_world, _ = core.motion.place(keys, k / 2)
            np.testing.assert_allclose(to_world, keys[k], rtol=1e-4, atol=2e-5 * np.abs(keys).max())


def test_the_shutters_curve_is_how_often_a_time_is_seen() -> None:
    curve = np.interp(np.linspace(0, 1, 256), [0.0, 0.3, 1.0], [0.0, 1.0, 0.2])
    u = (np.arange(200_000, dtype=np.float32) + 0.5) / 200_000
    times = core.motion.shutter_times(curve.tolist(), u.astype(np.float32))
    assert times.min() >= 0.0 and times.max() <= 1.0
    found, edges = np.histogram(times, 20, (0.0, 1.0))
    x = np.linspace(0, 1, 2001)
    expected = np.interp(x, [0.0, 0.3, 1.0], [0.0, 1.0, 0.2])
    share = np.array([expected[(x >= a) & (x <= b)].mean() for a, b in itertools.pairwise(edges)])
    np.testing.assert_allclose(found / found.sum(), share / share.sum(), atol=1e-3)


@pytest.mark.parametrize("curve", [[], [1.0], [0.7, 0.7, 0.7], [0.0, 0.0], [float("nan")] * 3])
def test_a_curve_that_says_nothing_leaves_times_alone(curve: list[float]) -> None:
    u = np.linspace(0, 0.999, 50, dtype=np.float32)
    assert np.array_equal(core.motion.shutter_times(curve, u), u)


def moving_scene() -> LuchScene:
    """A bit of everything: the pane and a leaf move and turn, the panel that glows changes its shape, the camera too."""
    scene = everything()
    instances = scene.instances
    assert instances is not None
    pane, leaf = (np.stack([instances.matrix[k]] * 3) for k in (1, 4))
    pane[0, 0, 3] -= 0.6
    pane[2, 0, 3] += 0.6
    for k, angle in enumerate((-0.8, 0.0, 0.8)):
        leaf[k, :, :3] = rotation(2, angle) @ leaf[k, :, :3]
    motion = InstanceMotion(np.array([1, 4], np.uint32), np.array([3, 3], np.uint32), np.concatenate([pane, leaf]))
    panel = scene.meshes[3].positions
    bent = panel * np.float32([1.5, 0.8, 1.0]) + np.float32([0.4, 0.0, 0.2])
    camera = np.stack([scene.camera.matrix] * 2)
    camera[0, 0, 3] -= 0.2
    return replace(
        scene,
        instances=replace(instances, motion=motion),
        meshes=[*scene.meshes[:3], replace(scene.meshes[3], motion_positions=np.stack([panel, bent]))],
        camera=replace(scene.camera, motion=CameraMotion(camera, (34.0, 40.0))),
        shutter=Shutter(curve=np.linspace(0.2, 1.0, 64, dtype=np.float32), rolling=0.5),
    )


def test_the_picture_of_what_moves_is_the_cpus(place: str) -> None:
    scene = moving_scene()
    cpu = render(scene)
    ours = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    assert ours.stats["kernel_plan"]["MOTION"]
    still = render(replace(scene, shutter=None)).passes["Combined"]
    assert np.abs(still - cpu.passes["Combined"])[..., :3].mean() > 0.01
    if place == FIBERS:
        np.testing.assert_allclose(ours.passes["Combined"], cpu.passes["Combined"], rtol=2e-6, atol=1e-7)
    else:
        differ = ~np.isclose(ours.passes["Combined"], cpu.passes["Combined"], rtol=1e-4, atol=1e-5)
        assert differ.mean() < 0.01

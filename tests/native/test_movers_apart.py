"""What moves lies apart from what stands still, behind a box that most rays pass by: they pay for nothing else of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch import core
from luch.cuda.device import cupy
from luch.cuda.trace import HIT, SceneTracer
from numpy.typing import NDArray
from support.accel_meshes import icosphere, random_rays, rows
from support.instances import ALL, NO_KINDS, Scene, placed
from support.moving import TIMES, Moving, rotation, same

FLATTEN = 10_000_000  # what stands still is one tree in the world
SLIDE_BYTES = 112  # luch::Slide


def at(x: float, y: float, z: float) -> NDArray[np.float64]:
    return np.hstack([np.eye(3), [[x], [y], [z]]])


def ball_below(moves: bool) -> Moving:
    """Six balls in a row, and a seventh far below them, which slides."""
    scene = Moving()
    scene.still = Scene([icosphere(2)])
    scene.still.instances = [(0, at(3.0 * k, 0.0, 0.0), ALL) for k in range(6)]
    scene.ways, scene.shapes = [], []
    if moves:
        scene.still.instances.append((0, at(6.0, 0.0, -20.0), ALL))
        scene.ways = [(6, np.stack([at(6.0 + x, 0.0, -20.0) for x in (-1.0, 1.0)]))]
    return scene


def rays_above(count: int = 500) -> NDArray[np.float32]:
    """Through the row, to its lower side; a third of them straight down."""
    rng = np.random.default_rng(1)
    origin, target = (
        rng.uniform((-2, -2, 2), (17, 2, 4), (count, 3)),
        rng.uniform((-2, -2, -2), (17, 2, -1), (count, 3)),
    )
    target[::3, :2] = origin[::3, :2]
    return rows(origin, target - origin, t_max=1.0)


@pytest.mark.parametrize("shadows", [False, True])
def test_a_mover_that_no_ray_comes_near_costs_no_node_and_no_primitive(shadows: bool) -> None:
    rays = rays_above()
    times = TIMES[np.arange(len(rays)) % len(TIMES)]
    still = ball_below(False).build(flatten=FLATTEN).work(rays, times, shadows)
    assert still["primitives"] > len(rays)
    assert ball_below(True).build(flatten=FLATTEN).work(rays, times, shadows) == still


def test_on_a_device_the_kernel_for_what_moves_gets_those_rays_alone_that_may_meet_it(place: str) -> None:
    trees = ball_below(True).build("CWBVH", for_device=True, flatten=FLATTEN)
    tracer = SceneTracer(*trees.device_image(), "CWBVH", "WATERTIGHT", trees.has_world_apart(), moves=True)
    cp, above = cupy(), rays_above()
    down = rows(np.array([6.0, 0.0, -9.0]), np.array([[0, 0, -1.0]]))  # at the seventh
    rays = cp.asarray(np.concatenate([above, down]))
    for trace, size in ((tracer.closest, HIT.itemsize), (tracer.any, 1)):
        results, near = cp.zeros(len(rays) * size, np.uint8), cp.zeros(len(rays), np.uint32)
        counts = cp.asarray(np.array([len(rays), 0, 0, 0], np.uint32))
        trace(rays.data.ptr, 0, results.data.ptr, counts.data.ptr, counts.data.ptr + 4, near=near.data.ptr)
        assert counts.get()[3] == 1 and near.get()[0] == len(above)
        assert results.get()[-size:].any()


def movers(count: int) -> Moving:
    """Of six instances the last so many stand still, in the world; the rest turn, stretch and shift."""
    scene = Moving()
    rng = np.random.default_rng(count)
    scene.shapes, scene.ways = [], []
    for instance in range(count):
        start = scene.still.instances[instance][1]
        end = placed(rng, 3.0)
        scene.ways.append((instance, np.stack([start, 0.5 * (start + end), end])))
    return scene


def towards_corners(scene: Moving, time: float, far: float) -> NDArray[np.float32]:
    """From all around to corners of what moves, as it stands at a time; every fourth ray along an axis."""
    rng = np.random.default_rng(5)
    targets = []
    for instance, matrices in scene.ways:
        to_world, _ = core.motion.place(matrices, time)
        points = scene.still.meshes[scene.still.instances[instance][0]][0]
        targets.append(points[::3] @ to_world[:, :3].T + to_world[:, 3])
    target = np.concatenate(targets)
    way = rng.normal(size=target.shape)
    way[::4] = np.eye(3)[rng.integers(3, size=len(way[::4]))] * rng.choice([-1.0, 1.0], (len(way[::4]), 1))
    return rows((target - far * way).astype(np.float32), way)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_rays_at_what_moves_hit_what_brute_force_hits(count: int) -> None:
    """Brute force asks every entry, and knows no boxes."""
    scene = movers(count)
    accel, truth = scene.build(flatten=FLATTEN), scene.build("BRUTE_FORCE", flatten=FLATTEN)
    for time in TIMES[1:4]:
        rays = np.concatenate([towards_corners(scene, float(time), far) for far in (5.0, 1e4)] + [random_rays(300)])
        rays[1::2, 7] = 5.0  # ends near the corners, where these are not far
        times = np.full(len(rays), time, np.float32)
        hits = truth.closest(rays, NO_KINDS, times)
        assert set(hits[4].tolist()) >= set(range(count))
        same(accel.closest(rays, NO_KINDS, times), hits)
        assert np.array_equal(accel.any(rays, NO_KINDS, times), truth.any(rays, NO_KINDS, times))


def test_what_only_changes_place_keeps_the_rest_of_its_transform() -> None:
    """Rays then need no turn and no inverse made for their time. That the hits are the same bits: test_motion.py."""
    slides, turns = ball_below(True), ball_below(True)
    _, end = turns.ways[0][1]
    end[:, :3] = rotation(2, 0.1)
    assert slides.build(flatten=FLATTEN).bytes() - turns.build(flatten=FLATTEN).bytes() == SLIDE_BYTES


@pytest.mark.parametrize("any_hit", [False, True])
def test_a_hidden_object_that_lets_light_through_costs_other_rays_nothing(any_hit: bool) -> None:
    scene = ball_below(False).still
    scene.instances.append((1, at(6.0, 0.0, -20.0), ALL))
    scene.meshes.append(icosphere(1))
    opaque, clear = (np.zeros(sum(len(t) for _, t in scene.meshes), np.uint8) for _ in range(2))
    clear[-len(scene.meshes[1][1]) :] = 1
    work, blocked = [], []
    for flags in (opaque, clear):
        scene.flags = flags
        accel = scene.build(flatten=FLATTEN)
        work.append(accel.count(rays_above(), any_hit))
        blocked.append(accel.any(rays_above(), NO_KINDS))
    assert work[0] == work[1] and work[0]["primitives"] > 0
    assert np.array_equal(*blocked) and set(blocked[0].tolist()) == {0, 1}


def through_boxes(size: float, place: float, far: float, seed: int) -> tuple[Any, Any, Any]:
    """A box (2, 3), rays to a point of it and just as far, and by how many sizes a ray's line misses the centre."""
    rng = np.random.default_rng(seed)
    center = place * rng.normal(size=3)
    box = np.stack([center - size * rng.random(3), center + size * rng.random(3)]).astype(np.float32)
    point = rng.uniform(box[0].astype(np.float64), box[1], (2000, 3))
    way = rng.normal(size=point.shape)
    way[::5, rng.integers(3)] = 0.0
    way[::7] = np.eye(3)[rng.integers(3, size=len(way[::7]))]
    origin = (point - far * size * way).astype(np.float32)
    direction = (point - origin).astype(np.float32)
    return box, rows(origin, direction, t_max=1.0), point


@pytest.mark.parametrize("size", [1e-20, 1e-3, 1.0, 1e6, 1e30])
@pytest.mark.parametrize("far", [0.3, 2.0, 1e3])
def test_no_ray_to_a_point_of_the_box_passes_it_by(size: float, far: float) -> None:
    for seed, place in enumerate((0.0, size, 1e3 * size)):
        box, rays, _ = through_boxes(size, place, far, seed)
        assert np.isfinite(rays[:, :7]).all()
        assert not core.motion.passes_by(box, rays).any()
        rays[:, 7] = np.inf
        assert not core.motion.passes_by(box, rays).any()


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e6])
def test_rays_that_end_begin_or_go_beside_the_box_pass_it_by(size: float) -> None:
    box, rays, point = through_boxes(size, size, 3.0, 4)
    origin, direction = rays[:, :3].astype(np.float64), rays[:, 4:7].astype(np.float64)
    away = rows(point + 4.0 * size * direction / np.linalg.norm(direction, axis=1)[:, None], direction)
    side = np.cross(direction, np.random.default_rng(2).normal(size=direction.shape))
    beside = rows(origin + 2.1 * size * side / np.linalg.norm(side, axis=1)[:, None], direction)
    short = rays.copy()
    short[:, 7] = 0.2
    outside = ((short[:, :3] < box[0]) | (short[:, :3] > box[1])).any(1)
    reach = short[:, :3] + 0.2 * short[:, 4:7]
    clear = outside & (((short[:, :3] < box[0]) & (reach < box[0])) | ((short[:, :3] > box[1]) & (reach > box[1]))).any(
        1
    )
    for missing in (away, beside, short[clear]):
        assert len(missing) > 500
        assert core.motion.passes_by(box, missing).all()

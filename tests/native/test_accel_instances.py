"""Two levels: instances answer as the same triangles would in place, masks hide them, rays leave surfaces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from luch import core
from luch.accel import KINDS, Accel
from support.accel_meshes import icosphere, random_rays, rows, separate
from support.instances import ALL, NO_KINDS, Scene, crowd, placed

CAMERA, SHADOW = 1, 32


@pytest.mark.parametrize("flatten", [0, 40_000, 10_000_000])
@pytest.mark.parametrize("count", [1, 2, 9, 60])
def test_instances_hit_bit_equal_to_brute_force(count: int, flatten: int) -> None:
    compare_with_brute_force(crowd(count), "BVH", flatten)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("BVH", "BRUTE_FORCE")])
@pytest.mark.parametrize("flatten", [0, 40_000])
def test_every_structure_serves_instances(kind: str, flatten: int) -> None:
    compare_with_brute_force(crowd(9), kind, flatten)


def compare_with_brute_force(scene: Scene, kind: str, flatten: int) -> None:
    rays = random_rays(400, scale=3.0)
    accel = scene.build(kind, flatten)
    ours, truth = accel.closest(rays, NO_KINDS), scene.build("BRUTE_FORCE", flatten).closest(rays, NO_KINDS)
    assert (truth[1] >= 0).any()
    for a, b in zip(ours, truth, strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))
    assert np.array_equal(accel.any(rays, NO_KINDS) != 0, truth[1] >= 0)


@pytest.mark.parametrize("flatten", [0, 10_000_000])
@pytest.mark.parametrize("distance", [0.0, 1e4, 1e6])
def test_instances_hit_where_their_triangles_are_in_the_world(distance: float, flatten: int) -> None:
    scene = crowd(30)
    for _, matrix, _ in scene.instances:
        matrix[:, 3] += distance
    rays = random_rays(4000, center=distance, scale=3.0)
    t, prim, u, v, instance = scene.build(flatten=flatten).closest(rays, NO_KINDS)
    hit = prim >= 0
    assert hit.sum() > 100
    along = rays[hit, :3].astype(float) + t[hit, None] * rays[hit, 4:7].astype(float)
    named = np.empty_like(along)
    for k, (p, i) in enumerate(zip(prim[hit], instance[hit], strict=True)):
        mesh, matrix, _ = scene.instances[i]
        points, triangles = scene.meshes[mesh]
        corner = points[triangles[p]].astype(float) @ matrix[:, :3].T + matrix[:, 3]
        b, c = u[hit][k], v[hit][k]
        named[k] = (1 - b - c) * corner[0] + b * corner[1] + c * corner[2]
    assert np.abs(along - named).max() <= 2e-5 + 1e-6 * distance


def test_closed_instances_let_no_ray_out() -> None:
    rng = np.random.default_rng(9)
    ball = icosphere(4)
    scene = Scene([ball])
    scene.instances = [(0, placed(rng, 1e4, scale=10.0), ALL) for _ in range(40)]
    accel = scene.build()
    for i, (_, matrix, _) in enumerate(scene.instances):
        corner = ball[0][ball[1][rng.integers(len(ball[1]), size=3000)]].astype(float)
        weights = rng.dirichlet(np.ones(3), 3000)
        weights[::2, 2] = 0
        aim = (corner * (weights / weights.sum(1, keepdims=True))[..., None]).sum(1) @ matrix[:, :3].T + matrix[:, 3]
        hits = accel.closest(rows(np.float32(matrix[:, 3]), aim - np.float32(matrix[:, 3])), NO_KINDS)
        assert (hits[4] == i).all()


def test_visibility_hides_instances_from_kinds_of_rays() -> None:
    here = np.eye(3, 4)
    for flatten in (0, 10_000_000):
        scene = Scene([icosphere(2)] * 3)
        for m, (scale, mask) in enumerate(((1.0, ALL & ~CAMERA), (2.0, ALL), (3.0, 0))):
            scene.instances += [(m, here * scale, mask), (m, here * scale * 1.1, mask)]
        ray = rows(np.array([[9.0, 0.1, 0.2]]), np.array([[-1.0, 0, 0]]))
        for kind in ("BVH", "BRUTE_FORCE", "KD_TREE"):
            accel = scene.build(kind, flatten)
            start = rows(np.zeros((1, 3)), np.array([[1.0, 0.1, 0.2]]))
            seen = [int(accel.closest(start, np.array([kind], np.uint32))[4][0]) for kind in (CAMERA, SHADOW, ALL)]
            assert seen == [2, 0, 0]
            assert accel.closest(ray, NO_KINDS)[4][0] == 3


def test_equal_hits_of_instances_go_to_the_smaller_instance() -> None:
    wall = separate(np.array([[(-9, -9, 2), (9, -9, 2), (0, 9, 2)]]))
    big = (np.tile(wall[0], (3000, 1)), np.tile(wall[1], (3000, 1)))
    scene = Scene([big, wall], [(0, np.eye(3, 4), ALL), (1, np.eye(3, 4), ALL), (0, np.eye(3, 4), ALL)])
    for order, flatten in itertools.product(((0, 1, 2), (1, 0, 2), (2, 1, 0)), (0, 10_000_000)):
        shuffled = Scene(scene.meshes, [scene.instances[i] for i in order])
        hit = shuffled.build(flatten=flatten).closest(rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]])), NO_KINDS)
        assert (hit[4][0], hit[1][0]) == (0, 0)


@pytest.mark.parametrize("flatten", [0, 10_000_000])
@pytest.mark.parametrize("scale", [0.0, 1e-20, np.inf, np.nan])
def test_broken_transforms_harm_nothing_else(scale: float, flatten: int) -> None:
    rng = np.random.default_rng(1)
    with np.errstate(invalid="ignore"):
        broken = np.eye(3, 4) * scale
    scene = Scene([icosphere(4), icosphere(1)])
    scene.instances = [(0, np.eye(3, 4), ALL), (0, broken, ALL), (1, broken, ALL), (0, placed(rng, 9.0), ALL)]
    alone = Scene(scene.meshes, [scene.instances[0], scene.instances[3]])
    rays = random_rays(2000, scale=3.0)
    ours, truth = (s.build(flatten=flatten).closest(rays, NO_KINDS) for s in (scene, alone))
    for a, b in zip(ours[:4], truth[:4], strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))


@pytest.mark.parametrize("far", [False, True])
def test_rays_that_leave_a_triangle_by_its_error_bound_do_not_meet_it_again(far: bool) -> None:
    rng = np.random.default_rng(19)
    again = 0
    for _ in range(300):
        shape = 10 ** rng.uniform(-8, 8, (3, 3)) * rng.choice([-1, 1], (3, 3))
        if far:
            shape = 10 ** rng.uniform(-4, 8) * rng.normal(size=3) + 10 ** rng.uniform(-4, 4) * rng.normal(size=(3, 3))
        corners = shape.astype(np.float32)
        normal = np.cross(*(corners[1:].astype(float) - corners[0].astype(float)))
        if not np.linalg.norm(normal) > 1e-20:
            continue
        normal /= np.linalg.norm(normal)
        weights = rng.dirichlet(np.ones(3), 200)
        weights[:40] = np.eye(3)[rng.integers(3, size=40)]
        direction = rng.normal(size=(200, 3))
        flat = direction - (direction @ normal)[:, None] * normal
        direction[::2] = flat[::2] + normal * 10 ** rng.uniform(-6, 0, (100, 1)) * rng.choice([-1, 1], (100, 1))
        rays = core.spawn_rays(
            np.tile(corners.reshape(1, 9), (200, 1)), np.float32(weights[:, 1:]), np.float32(direction)
        )
        again += int(Accel(corners, [[0, 1, 2]]).any(rays).sum())
    assert again == 0

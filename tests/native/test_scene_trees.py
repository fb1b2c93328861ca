"""The views that devices trace scenes by give the CPU's hits, bit for bit: here run on the CPU."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from luch.accel import STRUCTURES
from support.accel_meshes import icosphere, random_rays, rows, separate, soup
from support.instances import ALL, NO_KINDS, Scene, crowd, placed

FLATTEN = (0, 40_000, 10_000_000)  # none, some, all of the crowd's instances


def check_equal(
    scene: Scene, rays: Any, kinds: Any = NO_KINDS, kind: str = "CWBVH", flatten: int = 0, precision: int = 1
) -> Any:
    """Compares with the CPU, which asks every instance in turn; returns its closest hits."""
    truth, trees = scene.build("BRUTE_FORCE", flatten, precision), scene.trees(kind, flatten, precision)
    hits = truth.closest(rays, kinds)
    for name, ours, theirs in zip(("t", "prim", "u", "v", "instance"), trees.closest(rays, kinds), hits, strict=True):
        differ = np.flatnonzero(ours.view(np.uint32) != theirs.view(np.uint32))
        assert not len(differ), f"{name} of {len(differ)} rays, first {differ[0]}"
    assert np.array_equal(trees.any(rays, kinds), truth.any(rays, kinds))
    return hits


def mixed(scene: Scene) -> Scene:
    """The same: seen by some kinds of rays, a third of the triangles perhaps transparent, spheres in its first mesh."""
    rng = np.random.default_rng(8)
    scene.instances = [(m, matrix, int(rng.integers(64))) for m, matrix, _ in scene.instances]
    scene.spheres[0] = np.concatenate([rng.uniform(-2, 2, (20, 3)), rng.uniform(0, 0.4, (20, 1))], 1)
    scene.flags = (rng.random(sum(len(t) for _, t in scene.meshes)) < 0.3).astype(np.uint8)
    return scene


def some_kinds(rays: Any) -> Any:
    return (1 << np.random.default_rng(2).integers(6, size=len(rays))).astype(np.uint32)


@pytest.mark.parametrize("kind", STRUCTURES)
@pytest.mark.parametrize("flatten", FLATTEN)
def test_every_structure_answers_as_the_cpu_does(kind: str, flatten: int) -> None:
    rays = random_rays(150, scale=3.0)
    hits = check_equal(mixed(crowd(9)), rays, some_kinds(rays), kind, flatten)
    assert (hits[1] >= 0).sum() > 4


@pytest.mark.parametrize("precision", [0, 1, 2])
@pytest.mark.parametrize("flatten", FLATTEN)
@pytest.mark.parametrize("count", [1, 2, 60])
def test_few_and_many_instances_are_met_in_every_precision(count: int, flatten: int, precision: int) -> None:
    rays = random_rays(150, scale=3.0)
    check_equal(mixed(crowd(count)), rays, some_kinds(rays), "CWBVH", flatten, precision)


@pytest.mark.parametrize("distance", [1e4, 1e6])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_scenes_far_away_small_and_large_lose_no_hit(distance: float, scale: float) -> None:
    rng = np.random.default_rng(3)
    scene = Scene([icosphere(2), soup(200)])
    scene.instances = [(int(rng.integers(2)), placed(rng, 4 * scale, scale), ALL) for _ in range(40)]
    for _, matrix, _ in scene.instances:
        matrix[:, 3] += distance
    rays = random_rays(600, center=distance, scale=4 * scale)
    assert (check_equal(scene, rays)[1] >= 0).sum() > 40


def test_rays_along_the_axes_lose_no_hit() -> None:
    rng = np.random.default_rng(6)
    scene = Scene([icosphere(2), soup(100)])
    scene.instances = [(int(rng.integers(2)), placed(rng, 8.0), ALL) for _ in range(60)]
    start = rng.uniform(-9, 9, (1500, 3))
    along = np.eye(3)[rng.integers(3, size=1500)] * rng.choice([-1.0, 1.0], (1500, 1))
    assert (check_equal(scene, rows(start, along + rng.choice([0, 1e-8], (1500, 3))))[1] >= 0).sum() > 100


def test_ill_conditioned_instances_lose_no_hit() -> None:
    rng = np.random.default_rng(7)
    scene = Scene([icosphere(2), soup(50)])
    for _ in range(40):
        matrix = placed(rng, 5.0)
        matrix[:, :3] = (
            matrix[:, :3] @ np.diag(10.0 ** rng.uniform(-3, 1, 3)) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        )
        scene.instances.append((int(rng.integers(2)), matrix, ALL))
    assert (check_equal(scene, random_rays(3000, scale=4.0))[1] >= 0).sum() > 50


@pytest.mark.parametrize("scale", [0.0, 1e-20, 1e30, np.inf, np.nan])
def test_broken_transforms_are_answered_as_on_the_cpu(scale: float) -> None:
    rng = np.random.default_rng(1)
    with np.errstate(invalid="ignore"):
        broken = np.eye(3, 4) * scale
    scene = Scene([icosphere(3), icosphere(1)])
    scene.instances = [(0, np.eye(3, 4), ALL), (0, broken, ALL), (1, broken, ALL), (0, placed(rng, 9.0), ALL)]
    for flatten in FLATTEN:
        check_equal(scene, random_rays(300, scale=3.0), flatten=flatten)


def test_equal_hits_go_to_the_smaller_instance() -> None:
    wall = separate(np.array([[(-9, -9, 2), (9, -9, 2), (0, 9, 2)]]))
    big = (np.tile(wall[0], (300, 1)), np.concatenate([wall[1] + 3 * i for i in range(300)]))
    ray = rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]]))
    for order, flatten in itertools.product(itertools.permutations((0, 1, 0, 1)), (0, 400, 10_000_000)):
        scene = Scene([big, wall], [(mesh, np.eye(3, 4), ALL) for mesh in order])
        hit = check_equal(scene, ray, flatten=flatten)
        assert (hit[4][0], hit[1][0]) == (0, 0)


def test_a_scene_of_one_mesh_has_no_top_and_an_empty_one_has_nothing() -> None:
    rays = random_rays(200)
    one = Scene([icosphere(3), soup(0)], [(0, np.eye(3, 4), ALL), (1, np.eye(3, 4), ALL)])
    assert one.trees().is_one_group()
    assert (check_equal(one, rays)[1] >= 0).any()
    empty = Scene([soup(0)], [(0, np.eye(3, 4), ALL)])
    assert empty.trees().stats()["entries"] == 0
    assert (check_equal(empty, rays)[1] == -1).all()
    assert not crowd(9).trees().is_one_group()
    assert crowd(9).trees(flatten=10_000_000).is_one_group()


def test_the_image_leads_every_pointer_into_a_block() -> None:
    blocks, links = mixed(crowd(12)).trees("KD_TREE").device_image()
    assert blocks[0][0] == "scene trees"
    assert len(links) > 12
    for block, offset, target, target_offset in links:
        assert offset % 8 == 0
        assert offset + 8 <= len(blocks[block][1])
        assert target_offset <= len(blocks[target][1])


def test_large_trees_do_not_depend_on_the_number_of_threads() -> None:
    scene = crowd(9)
    scene.meshes.append(icosphere(6))  # 82 thousand triangles: several threads build it
    scene.instances += [(3, placed(np.random.default_rng(5), 5.0), ALL), (3, np.eye(3, 4), ALL)]
    trees = [scene.trees(threads=threads) for threads in (1, 3)]
    (ours, links), (theirs, their_links) = (t.device_image() for t in trees)
    assert links == their_links
    with_pointers = {block for block, *_ in links}
    for block, ((name, data), (their_name, their_data)) in enumerate(zip(ours, theirs, strict=True)):
        assert name == their_name
        assert block in with_pointers or np.array_equal(data, their_data)
    rays = random_rays(2000, scale=3.0)
    for a, b in zip(trees[1].closest(rays, NO_KINDS), scene.build().closest(rays, NO_KINDS), strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))

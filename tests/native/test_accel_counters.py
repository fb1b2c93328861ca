"""The work that the eight-wide tree says it did."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.accel import PRECISIONS, Accel
from support.accel_meshes import icosphere, random_rays, rows, soup

NODE_BYTES, BLOCK_BYTES, BOXES = 256, 160, 8
TRIANGLE = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32)


def copies(count: int) -> tuple[Any, Any]:
    """A triangle again and again, each a hair off the others: builders leave out what is just the same."""
    points = np.tile(TRIANGLE, (count, 1))
    points[::3, 2] += np.arange(count, dtype=np.float32) * np.float32(2**-20)
    return points, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def through(x: float, y: float) -> Any:
    """A ray up at that place."""
    return rows(np.array([[x, y, 0.0]]), np.array([[0.0, 0, 1]]))


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("any_hit", [False, True])
def test_one_triangle_costs_one_node_and_one_block(precision: Any, any_hit: bool) -> None:
    accel = Accel(*copies(1), precision=precision)
    work = {"nodes": 1, "boxes": BOXES, "primitives": 1, "bytes": NODE_BYTES + BLOCK_BYTES}
    assert accel.count(through(0.2, 0.2), any_hit) == work
    beside = {"nodes": 1, "boxes": BOXES, "primitives": 0, "bytes": NODE_BYTES}
    assert accel.count(through(5, 5), any_hit) == beside


def test_triangles_that_cannot_be_told_apart_are_tested_as_often_as_by_brute_force() -> None:
    mesh, rays = copies(37), np.repeat(through(0.2, 0.2), 3, 0)
    wide, brute = Accel(*mesh), Accel(*mesh, kind="BRUTE_FORCE")
    assert wide.count(rays)["primitives"] == brute.count(rays)["primitives"] == 37 * 3


@pytest.mark.parametrize("any_hit", [False, True])
def test_wide_tree_visits_fewer_nodes_than_the_binary_one(any_hit: bool) -> None:
    mesh, rays = icosphere(5), random_rays(2000)
    wide, binary = (Accel(*mesh, kind=kind).count(rays, any_hit) for kind in ("BVH", "BVH2"))
    assert wide["nodes"] <= 0.5 * binary["nodes"]  # 0.38 measured
    assert wide["boxes"] == BOXES * wide["nodes"]
    blocks, rest = divmod(wide["bytes"] - NODE_BYTES * wide["nodes"], BLOCK_BYTES)
    assert rest == 0
    assert blocks <= wide["primitives"] <= 4 * blocks


def test_work_is_the_same_however_rays_are_shared_among_threads() -> None:
    mesh, rays = soup(500), random_rays(10_000)
    assert Accel(*mesh, threads=1).count(rays) == Accel(*mesh, threads=3).count(rays)


def test_rays_that_hit_nothing_by_themselves_cost_nothing() -> None:
    rays = rows(np.zeros((4, 3)), np.eye(4, 3))
    rays[0, 0], rays[1, 4:7], rays[2, 7], rays[3, 4:7] = np.nan, 0, -1, np.inf
    assert set(Accel(*soup(20)).count(rays).values()) == {0}


def test_spheres_count_beside_the_triangles() -> None:
    ray = through(0.8, 0.8)  # through both boxes, past the triangle and the sphere
    spheres = np.array([[0.4, 0.4, 3, 0.5]], np.float32)
    alone, both = Accel(*copies(1)).count(ray), Accel(*copies(1), spheres=spheres).count(ray)
    assert (alone["primitives"], both["primitives"]) == (1, 2)
    assert both["nodes"] > alone["nodes"]

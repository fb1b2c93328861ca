"""The wide tree gives brute force's hits, bit for bit, and closed meshes let nothing through."""

from __future__ import annotations

import numpy as np
import pytest
from luch.accel import Accel, Precision
from numpy.typing import NDArray
from support.accel_meshes import (
    aimed_rays,
    differences,
    icosphere,
    random_rays,
    rows,
    separate,
    soup,
)

RAYS = 3000


@pytest.mark.parametrize("scale", [1e-18, 1e-9, 1e-3, 1e6, 1e18])
def test_tree_hits_are_bit_equal_to_brute_force_at_any_scale(scale: float) -> None:
    points, triangles = soup()
    mesh = ((points * scale).astype(np.float32), triangles)
    differ, hit = differences(mesh, np.concatenate([random_rays(RAYS, scale=scale), aimed_rays(mesh, RAYS)]))
    assert differ == 0
    assert hit > RAYS


@pytest.mark.parametrize("distance", [1e3, 1e5, 1e7])
def test_tree_hits_are_bit_equal_to_brute_force_far_from_the_origin(distance: float) -> None:
    points, triangles = soup()
    mesh = ((points * 10 + np.float32([1, 0.7, -1.3]) * distance).astype(np.float32), triangles)
    differ, hit = differences(mesh, aimed_rays(mesh, 2 * RAYS))
    assert differ == 0
    assert hit > RAYS


def test_interval_is_open_below_and_closed_above() -> None:
    wall = separate(np.array([[(-9, -9, 2), (9, -9, 2), (0, 9, 2)]]))
    rays = np.concatenate([rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), lo, hi)
                           for lo, hi in ((0, 2), (2, 9), (0, np.nextafter(np.float32(2), np.float32(0))),
                                          (np.nextafter(np.float32(2), np.float32(0)), 9), (-5, 9))])  # fmt: skip
    for kind in ("BVH", "BRUTE_FORCE"):
        assert list(Accel(*wall, kind=kind).any(rays)) == [True, False, False, True, True]  # type: ignore[arg-type]


def test_of_equal_hits_the_smaller_index_wins() -> None:
    points, triangles = soup(1, 1.0)
    mesh = (points, np.tile(triangles, (777, 1)))
    _, prim, _, _ = Accel(*mesh).closest(aimed_rays(mesh, RAYS))
    assert set(prim) == {-1, 0}


def test_rays_that_are_not_rays_miss() -> None:
    mesh = icosphere(2)
    bad: list[list[float]] = []
    for value in (np.nan, np.inf, -np.inf):
        for field in (0, 1, 2, 4, 5, 6):
            ray = [0, 0, 0, 0, 0.1, 0.2, 0.3, np.inf]
            ray[field] = value
            bad.append(ray)
    bad += [[0, 0, 0, 0, 0, 0, 0, np.inf], [0, 0, 0, np.nan, 0, 0, 1, 9], [0, 0, 0, 0, 0, 0, 1, np.nan],
            [0, 0, 0, 5, 0, 0, 1, 2], [0, 0, 0, 0, 0, 0, 1, -1], [0, 0, 0, 0, 1e-45, 0, 0, 9]]  # fmt: skip
    rays = np.array(bad, np.float32)
    for kind in ("BVH", "BRUTE_FORCE"):
        accel = Accel(*mesh, kind=kind)  # type: ignore[arg-type]
        t, prim, _, _ = accel.closest(rays)
        assert (prim == -1).all()
        assert (t == np.inf).all()
        assert not accel.any(rays).any()


def test_index_outside_the_mesh_drops_its_triangle() -> None:
    points, triangles = soup(10)
    triangles[3, 1] = 4_000_000_000
    assert Accel(points, triangles).stats["dropped_triangles"] == 1


def test_empty_mesh_is_missed() -> None:
    for points in (np.zeros((0, 3), np.float32), np.full((3, 3), np.nan, np.float32)):
        triangles = np.arange(len(points), dtype=np.uint32).reshape(-1, 3)
        accel = Accel(points, triangles)
        assert (accel.closest(random_rays(10))[1] == -1).all()
        assert not accel.any(random_rays(10)).any()


def test_tracing_no_rays_returns_empty_arrays() -> None:
    t, prim, _, _ = Accel(*soup(5)).closest(np.zeros((0, 8), np.float32))
    assert len(t) == len(prim) == 0


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_change_no_bit_of_tree_or_hits(threads: int) -> None:
    points, triangles = icosphere(6)  # 81,920: several chunks and tasks
    one, many = Accel(points, triangles, threads=1), Accel(points, triangles, threads=threads)
    for key in ("nodes", "leaf_blocks", "bytes"):
        assert one.stats[key] == many.stats[key]
    for a, b in zip(one.closest(random_rays(20_000)), many.closest(random_rays(20_000)), strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))


def test_tree_of_a_large_mesh_is_small_and_bit_equal_on_samples() -> None:
    points, triangles = icosphere(6)
    rng = np.random.default_rng(5)
    points = points * (1 + 0.02 * rng.normal(size=(len(points), 1))).astype(np.float32)
    assert Accel(points, triangles).stats["bytes"] <= 66 * len(triangles)
    differ, hit = differences((points, triangles), aimed_rays((points, triangles), 300))
    assert differ == 0
    assert hit > 200


@pytest.mark.parametrize(
    "corners",
    [
        np.repeat(np.random.default_rng(1).normal(size=(1, 3, 3)), 100_000, axis=0),
        np.random.default_rng(1).normal(size=(100_000, 3, 3)) * [1, 1, 0],
        0.9999 ** np.arange(100_000)[:, None, None] * np.random.default_rng(1).normal(size=(1, 3, 3)),
        2.0 ** -(np.arange(100_000) % 120)[:, None, None] * np.random.default_rng(1).normal(size=(1, 3, 3)),
    ],
    ids=["identical", "in one plane", "shrinking slowly", "shrinking fast"],
)
def test_builder_finishes_with_a_small_tree_on(corners: np.ndarray) -> None:
    accel = Accel(*separate(corners))
    assert accel.stats["triangles"] + accel.stats["duplicate_primitives"] == len(corners)
    assert accel.stats["bytes"] <= 120 * len(corners)
    assert accel.closest(random_rays(10))[0].shape == (10,)


def test_blocked_tells_opaque_from_maybe_transparent() -> None:
    def wall(z: float) -> list[list[float]]:
        return [[-9, -9, z], [9, -9, z], [0, 9, z]]

    points, triangles = separate(np.array([wall(1), wall(2), wall(3)]))
    flags = [True, False, True]
    rays = np.concatenate([rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), lo, hi)
                           for lo, hi in ((0, 0.5), (0, 1.5), (0, 2.5), (2.5, 9), (3.5, 9))])  # fmt: skip
    for kind in ("BVH", "BRUTE_FORCE"):
        accel = Accel(points, triangles, kind=kind, may_be_transparent=flags)  # type: ignore[arg-type]
        assert list(accel.blocked(rays)) == [0, 2, 1, 2, 0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": np.zeros((3, 2), np.float32)}, r"positions has shape \(3, 2\)"),
        ({"positions": np.array([["a", "b", "c"]])}, "positions holds"),
        ({"triangles": np.zeros((1, 4), np.uint32)}, r"triangles has shape \(1, 4\)"),
        ({"triangles": np.zeros((1, 3), np.float32)}, "triangles holds float32"),
        ({"triangles": np.array([[0, 1, -1]])}, "index outside"),
        ({"kind": "OCTREE"}, "kind is 'OCTREE'"),
        ({"threads": -1}, "threads is -1"),
        ({"may_be_transparent": [True, False]}, r"may_be_transparent has shape \(2,\)"),
    ],
)
def test_bad_input_raises_one_clear_error(change: dict[str, object], message: str) -> None:
    good: dict[str, object] = {"positions": np.zeros((3, 3), np.float32), "triangles": np.array([[0, 1, 2]])}
    with pytest.raises(ValueError, match=message):
        Accel(**(good | change))  # type: ignore[arg-type]


def test_bad_rays_raise_one_clear_error() -> None:
    with pytest.raises(ValueError, match=r"rays has shape \(4, 6\)"):
        Accel(*soup(1)).closest(np.zeros((4, 6), np.float32))


def balls(count: int = 40, seed: int = 6) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return np.hstack([rng.uniform(-1, 1, (count, 3)), rng.uniform(0.01, 0.3, (count, 1))]).astype(np.float32)


@pytest.mark.parametrize("precision", ["WATERTIGHT", "DOUBLE"])
def test_tree_of_triangles_and_spheres_hits_bit_equal_to_brute_force(precision: Precision) -> None:
    mesh = soup()
    rays = np.concatenate([random_rays(RAYS), aimed_rays(mesh, RAYS)])
    tree = Accel(*mesh, spheres=balls(), precision=precision)
    oracle = Accel(*mesh, kind="BRUTE_FORCE", spheres=balls(), precision=precision)
    for a, b in zip(tree.closest(rays), oracle.closest(rays), strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))
    assert np.array_equal(tree.any(rays), oracle.any(rays))
    prim = tree.closest(rays)[1]
    assert (prim >= len(mesh[1])).any() and (prim < len(mesh[1])).any()
    assert tree.stats["spheres"] == 40


def test_fast_tree_hits_what_fast_brute_force_hits() -> None:
    """Bit for bit where it hits; its boxes are not made for a rounding test, so a few rays in a million may differ."""
    mesh = icosphere(3)
    rays = np.concatenate([random_rays(RAYS), aimed_rays(mesh, RAYS)])
    ours, truth = (Accel(*mesh, kind=kind, precision="FAST").closest(rays) for kind in ("BVH", "BRUTE_FORCE"))
    same = ours[1] == truth[1]
    assert (~same).sum() <= 2
    for a, b in zip(ours, truth, strict=True):
        assert np.array_equal(a[same].view(np.uint32), b[same].view(np.uint32))


def test_sphere_far_away_is_hit_where_it_is() -> None:
    """The textbook quadratic cancels here: radius 1 at 1e5 leaves it no digits in single precision."""
    far = np.float32([[1e5, 0, 0, 1.0]])
    rays = rows(np.zeros((3, 3)), np.array([[1, 0, 0], [1, 0.9e-5, 0], [1, 1.1e-5, 0]]))
    none = np.zeros((0, 3))
    for kind in ("BVH", "BRUTE_FORCE"):
        t, prim, _, _ = Accel(none, np.zeros((0, 3), np.uint32), kind=kind, spheres=far).closest(rays)  # type: ignore[arg-type]
        assert list(prim) == [0, 0, -1]
        assert t[0] == 1e5 - 1
        assert t[1] == pytest.approx(1e5 - np.sqrt(1 - 0.81), abs=0.01)


def test_ray_from_inside_a_sphere_hits_its_far_side() -> None:
    one = np.float32([[0, 0, 0, 2.0]])
    ray = rows(np.float32([[0.5, 0, 0]]), np.array([[-1.0, 0, 0]]))
    t, prim, u, v = Accel(np.zeros((0, 3)), np.zeros((0, 3), np.uint32), spheres=one).closest(ray)
    assert (t[0], prim[0], u[0], v[0]) == (2.5, 0, 0.0, 0.0)

"""Every structure gives brute force's hits, bit for bit. Numbers: the rows of the list of hard cases.

On a GPU: test_structures_cuda.py. What else structures promise stands in tests/native/test_accel*.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from luch.accel import KINDS, QUALITIES, Accel, Device, Kind, Quality
from support.accel_meshes import HARD_MESHES, aimed_rays, differences, icosphere, random_rays
from support.asked import every_device
from support.hard_rays import OF_CELLS, OF_TREES, assert_same_hits, bits_differ, hard_rays, truth

TREES: tuple[Kind, ...] = ("BVH2", "BVH2_STACKLESS", "CWBVH")
CELLS: tuple[Kind, ...] = ("KD_TREE", "GRID", "HIERARCHICAL_GRID")
FLAT = ("collinear", "points")  # without area: no ray meets them


@pytest.mark.parametrize("name", HARD_MESHES)
def test_20_the_wide_trees_hits_are_bit_equal_to_brute_force(name: str) -> None:
    mesh = HARD_MESHES[name]
    differ, hit = differences(mesh, np.concatenate([random_rays(3000), aimed_rays(mesh, 3000)]))
    assert differ == 0
    assert hit > 0 or name in FLAT, "these rays prove nothing"


@pytest.mark.parametrize(("kind", "quality"), [(kind, quality) for kind in TREES for quality in QUALITIES])
@pytest.mark.parametrize("name", OF_TREES)
def test_20_a_trees_hits_are_bit_equal_to_brute_force(name: str, kind: Kind, quality: Quality) -> None:
    rays, expected = truth(name)
    tree = Accel(*OF_TREES[name], kind=kind, quality=quality)
    assert bits_differ((*tree.closest(rays), tree.blocked(rays)), expected) == 0
    assert (expected[1] >= 0).sum() > 600 or name in FLAT, "these rays prove nothing"


@pytest.mark.parametrize("kind", CELLS)
@pytest.mark.parametrize("name", OF_CELLS)
def test_20_hits_in_cells_are_bit_equal_to_brute_force(name: str, kind: Kind) -> None:
    accel = Accel(*OF_CELLS[name], kind=kind, threads=1)
    hit = assert_same_hits(accel, OF_CELLS[name], hard_rays(OF_CELLS[name]))
    assert hit > 0 or name in FLAT, "these rays prove nothing"


@pytest.mark.full
@every_device
@pytest.mark.parametrize("name", HARD_MESHES)
def test_20_a_million_random_rays_hit_alike_in_all_structures(name: str, device: Device) -> None:
    mesh, hit = HARD_MESHES[name], 0
    structures = [Accel(*mesh, kind=kind, device=device) for kind in KINDS]
    for seed in range(16):
        rays = random_rays(1 << 16, seed=seed)
        expected = Accel(*mesh, kind="BRUTE_FORCE").closest(rays)
        hit += int((expected[1] >= 0).sum())
        for accel in structures:
            assert bits_differ(accel.closest(rays), expected) == 0, accel.kind
            assert np.array_equal(accel.any(rays), expected[1] >= 0), accel.kind
    print(f"{hit} of {16 << 16} rays hit")
    assert hit > 1000 or name in (*FLAT, "needles")


def kept_and_dropped(accel: Accel) -> tuple[int, int]:
    """Triangles, as the wide tree of the CPU and as all others tell them."""
    stats = accel.stats
    wide = "dropped_triangles" in stats
    return (stats["triangles"], stats["dropped_triangles"]) if wide else (stats["primitives"], stats["dropped"])


@every_device
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [np.nan, np.inf, 3e38])
def test_24_triangles_of_a_broken_vertex_are_dropped_counted_and_harm_nothing_else(
    value: float, kind: Kind, device: Device
) -> None:
    points, triangles = icosphere(2)
    points = points.copy()
    points[7] = value
    mesh = (points, triangles)
    whole = triangles[(triangles != 7).all(1)]
    accel = Accel(*mesh, kind=kind, device=device)
    assert kept_and_dropped(accel) == (len(whole), len(triangles) - len(whole))
    # Of the whole faces alone, whose numbers differ.
    rays = np.concatenate([random_rays(2000), aimed_rays((icosphere(2)[0], triangles), 2000)])
    left = Accel(points, whole, kind="BRUTE_FORCE").closest(rays)
    assert assert_same_hits(accel, mesh, rays) == (left[1] >= 0).sum() > 1000
    assert np.array_equal(accel.closest(rays)[0], left[0])


@every_device
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_24_a_mesh_of_broken_vertices_alone_is_missed(value: float, kind: Kind, device: Device) -> None:
    points, triangles = icosphere(2)
    accel = Accel(np.full_like(points, value), triangles, kind=kind, device=device)
    assert kept_and_dropped(accel) == (0, len(triangles))
    t, prim, _, _ = accel.closest(random_rays(500))
    assert (prim == -1).all() and (t == np.inf).all()
    assert not accel.any(random_rays(500)).any()


def test_24_the_wide_trees_hits_beside_a_broken_vertex_are_bit_equal_to_brute_force() -> None:
    """One ray at a time and many together, as the tree interleaves them."""
    points, triangles = icosphere(2)
    for value in (np.nan, np.inf, 3e38):
        broken = points.copy()
        broken[7] = value
        differ, hit = differences((broken, triangles), random_rays(3000))
        assert differ == 0 and hit > 0

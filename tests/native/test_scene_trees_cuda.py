"""The kernels that trace a render's rays give the CPU's hits, bit for bit.

Each test runs twice: on a GPU (marker `cuda`; tests/bench/records tells when last), and anywhere with the kernels'
source run by fibers on the CPU, which proves their logic and the Python around them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch.accel import STRUCTURES
from luch.cuda.scene_kernels import structure_flags
from luch.cuda.trace import SceneTracer, TreesTooDeep
from support.accel_meshes import icosphere, random_rays, rows, soup
from support.cuda_on_cpu import GPU, compiles
from support.instances import ALL, Scene, crowd, placed

from buildtools.kernels import Unit, faults, table

NATIVE = Path(__file__).resolve().parents[2] / "native"
FEW = (
    "BRUTE_FORCE",
    "BVH2",
    "CWBVH",
    "KD_TREE",
)  # for the fibers: the others' kernels are the same template, and slow to compile
PRECISIONS = ("FAST", "WATERTIGHT", "DOUBLE")


def check_equal(scene: Scene, rays: Any, kinds: Any, kind: str, flatten: int, precision: str = "WATERTIGHT") -> Any:
    """Compares with the CPU's scheme; returns its hits."""
    oracle = scene.build("BVH", flatten, PRECISIONS.index(precision))
    trees = scene.trees(kind, flatten, PRECISIONS.index(precision))
    tracer = SceneTracer(*trees.device_image(), kind, precision, trees.has_world_apart())
    return compare(tracer, oracle, rays, kinds)


def compare(tracer: SceneTracer, oracle: Any, rays: Any, kinds: Any) -> Any:
    """The oracle's closest hits, which the device's equal."""
    truth = oracle.closest(rays, kinds)
    hits = tracer.closest_of(rays, kinds)
    for name, expected in zip(("t", "prim", "u", "v", "instance"), truth, strict=True):
        differ = np.flatnonzero(np.ascontiguousarray(hits[name]).view(np.uint32) != expected.view(np.uint32))
        assert not len(differ), f"{name} of {len(differ)} rays, first {differ[0]}"
    assert np.array_equal(tracer.any_of(rays, kinds), oracle.any(rays, kinds))
    return truth


def mixed_rays(place: str, seed: int = 5) -> tuple[Any, Any]:
    """Rays that go together, rays that do not, some that can hit nothing; and of which kinds they are."""
    rng = np.random.default_rng(seed)
    spread = 0.2 * np.stack(np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 8)), -1).reshape(-1, 2)
    rays = np.concatenate(
        [
            rows(np.array([0, 0, -9.0]), np.insert(spread, 2, 1.0, axis=1)),
            random_rays(30_000 if place == GPU else 150, scale=3.0),
        ]
    )
    rays[::7, 7] = np.linspace(0.1, 9, len(rays[::7]))
    rays[::11, 3] = 0.3
    rays[3, 4:7], rays[4, 0], rays[5, 7], rays[6, 3], rays[8, 3] = 0, np.nan, -1, np.nan, -5
    return rays, (1 << rng.integers(6, size=len(rays))).astype(np.uint32)


def hidden(scene: Scene, seed: int = 8) -> Scene:
    """The same, unseen by some kinds of rays, a third of the triangles perhaps transparent, spheres in its first mesh."""
    rng = np.random.default_rng(seed)
    scene.instances = [(m, matrix, int(rng.integers(64))) for m, matrix, _ in scene.instances]
    scene.spheres[0] = np.concatenate([rng.uniform(-2, 2, (9, 3)), rng.uniform(0, 0.4, (9, 1))], 1)
    scene.flags = (rng.random(sum(len(t) for _, t in scene.meshes)) < 0.3).astype(np.uint8)
    return scene


@pytest.mark.parametrize("kind", [k if k in FEW else pytest.param(k, marks=pytest.mark.cuda) for k in STRUCTURES])
@pytest.mark.parametrize("flatten", [0, 10_000_000])
def test_every_structure_serves_instances_on_the_device(place: str, kind: str, flatten: int) -> None:
    rays, kinds = mixed_rays(place)
    truth = check_equal(hidden(crowd(12, spread=2.0)), rays, kinds, kind, flatten)
    assert (truth[1] >= 0).sum() > 20


@pytest.mark.parametrize("precision", ["WATERTIGHT", "DOUBLE"])
@pytest.mark.parametrize(("count", "flatten"), [(1, 0), (1, 10_000_000), (40, 0), (40, 40_000), (40, 10_000_000)])
def test_the_compressed_tree_serves_few_and_many(place: str, count: int, flatten: int, precision: str) -> None:
    rays, kinds = mixed_rays(place, count)
    scene = crowd(count, spread=3.0)
    check_equal(scene, rays, np.full(len(rays), ALL, np.uint32), "CWBVH", flatten, precision)
    check_equal(hidden(scene), rays, kinds, "CWBVH", flatten, precision)


def test_nothing_to_hit_and_no_rays_are_answered(place: str) -> None:
    empty = Scene([soup(3)], [])
    rays, kinds = mixed_rays(place)
    assert (check_equal(empty, rays, kinds, "CWBVH", 0)[1] == -1).all()
    check_equal(crowd(9), rays[:0], kinds[:0], "CWBVH", 0)


@pytest.mark.parametrize("flatten", [0, 10_000_000])
def test_groups_that_the_device_builds_give_the_same_hits(place: str, flatten: int) -> None:
    rng = np.random.default_rng(3)
    scene = Scene([icosphere(3), soup(700), soup(7)])
    scene.instances = [(m % 3, placed(rng, 2.0), ALL) for m in range(9)]
    if flatten == 0:
        hidden(scene)
    scene.meshes[0][0][5] = np.nan  # its triangles are left out
    rays, kinds = mixed_rays(place)
    trees = scene.trees(flatten=flatten, leave_from=600)
    left = trees.left_groups()
    assert len(left) == (2 if flatten == 0 else 1)
    assert trees.is_one_group() == (flatten > 0)
    depth = trees.stats()["depth"]
    tracer = SceneTracer(*trees.device_image(), "CWBVH", "WATERTIGHT", trees.has_world_apart(), left, depth)
    truth = scene.build(flatten=flatten)
    compare(tracer, truth, rays, kinds)
    with pytest.raises(TreesTooDeep):
        SceneTracer(*trees.device_image(), "CWBVH", "WATERTIGHT", False, left, 96)


def test_equal_hits_go_to_the_smaller_instance_on_the_device(place: str) -> None:
    rng = np.random.default_rng(3)
    points, triangles = icosphere(1)
    twice = (points, np.concatenate([triangles, triangles[::-1]]))
    scene = Scene([twice, twice], [(int(mesh), np.eye(3, 4), ALL) for mesh in rng.permutation([0, 1] * 6)])
    rays, _ = mixed_rays(place)
    assert (check_equal(scene, rays, np.full(len(rays), ALL, np.uint32), "CWBVH", 0)[4] == 0).any()


def test_ptx_of_scenes_obeys_the_rules_of_precision() -> None:
    assert set(table()["tracers"]) == {f"TRACE_{kind}" for kind in STRUCTURES}
    assert not faults(Unit("TRACE_CWBVH", "WATERTIGHT"), "fma.rn.f32")
    assert faults(Unit("TRACE_CWBVH", "WATERTIGHT"), "fma.rn.f64")
    assert faults(Unit("TRACE_CWBVH", "FAST"), "mul.f64")


@pytest.mark.parametrize("kind", STRUCTURES)
def test_stages_can_trace_single_rays_through_any_structure(kind: str) -> None:
    """Those that look through surfaces one by one: scenes of five structures did not compile."""
    assert compiles('#include "render/one_ray.cuh"\n', [NATIVE / "include", NATIVE / "cuda"], structure_flags(kind))

"""The views that devices trace scenes by give the CPU's hits, bit for bit: here run on the CPU."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.accel import STRUCTURES
from support.accel_meshes import random_rays
from support.instances import NO_KINDS, Scene, crowd

FLATTEN = (0, 40_000, 10_000_000)  # none, some, all of the crowd's instances


def check_equal(scene: Scene, rays: Any, kinds: Any = NO_KINDS, **options: Any) -> Any:
    """Compares with the CPU's scheme over the same structures; returns its closest hits."""
    truth, ours = scene.build("BRUTE_FORCE", **options), scene.trees
    kind = options.pop("kind", "CWBVH")
    trees = ours(kind, **options)
    hits = truth.closest(rays, kinds)
    for a, b in zip(trees.closest(rays, kinds), hits, strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))
    assert np.array_equal(trees.any(rays, kinds), truth.any(rays, kinds))
    return hits


@pytest.mark.parametrize("kind", STRUCTURES)
@pytest.mark.parametrize("flatten", FLATTEN)
def test_every_structure_answers_as_the_cpu_does(kind: str, flatten: int) -> None:
    scene = crowd(9)
    rays = random_rays(300, scale=3.0)
    truth, trees = scene.build("BVH", flatten), scene.trees(kind, flatten)
    hits = truth.closest(rays, NO_KINDS)
    assert (hits[1] >= 0).sum() > 20
    for a, b in zip(trees.closest(rays, NO_KINDS), hits, strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))
    assert np.array_equal(trees.any(rays, NO_KINDS), truth.any(rays, NO_KINDS))

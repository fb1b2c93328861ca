"""Hair at its limits. Numbers: the rows of the list of hard cases, as they are for curves.

That every structure draws strands of no length, no radius, coinciding points and loops as brute force does stands in
tests/native/test_curves.py, and so do places to 1e6 and sizes from 1e-6 to 1e6.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Scene
from support.hair import clear_fibre, scene_of, strands

SHAPES = ("RIBBON", "THICK", "THICK_LINEAR")
GOOD = ((-1.2, -0.5, 0.0, 0.2), (-0.3, 0.4, 0.3, 0.25), (0.6, -0.2, 0.5, 0.2), (1.2, 0.6, 0.2, 0.1))
NAN, INF = float("nan"), float("inf")

every_shape = pytest.mark.parametrize("shape", SHAPES)


def rendered(scene: Scene) -> Result:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    assert all(np.isfinite(picture).all() for picture in result.passes.values())
    return result


def beside(shape: str, *bad: Any, **options: Any) -> Result:
    """The good strand, and others in the same mesh."""
    return rendered(scene_of(strands(GOOD, *bad), shape=shape, **options))


@every_shape
@pytest.mark.parametrize(
    ("row", "bad"),
    [
        (23, [[0, 0, 0, 0.0]]),
        (23, [[0, 0, 0, 0.5]]),
        (23, [[0, 0, 0, 0.0], [1, 0, 0, 0.0], [1, 1, 0, 0.0]]),
        (23, [[0, 0, 0, -0.3], [1, 0, 0, -0.3]]),
        (24, [[0, 0, 0, 0.3], [NAN, 0, 0, 0.3]]),
        (24, [[0, 0, 0, NAN], [1, 0, 0, NAN]]),
        (24, [[0, INF, 0, 0.3], [1, 0, -INF, 0.3]]),
        (24, [[0, 0, 0, INF], [1, 0, 0, 0.3]]),
        (25, [[-3e38, 0, 0, 0.3], [3e38, 1, 0, 0.3], [3e38, -3e38, 0, 0.3]]),
        (25, [[0, 0, 0, 3e38], [1, 0, 0, 3e38]]),
        (26, [[0, 0, 0, 1e-40], [1e-40, 0, 0, 1e-40]]),
        (26, [[0, 0, 0, 1e-30], [1e-30, 1e-30, 0, 1e-30], [0, 2e-30, 1e-30, 1e-30]]),
    ],
)
def test_rows_23_to_26_a_strand_that_cannot_be_drawn_leaves_the_others_as_they_are(
    shape: str, row: int, bad: Any
) -> None:
    alone, with_bad = beside(shape), beside(shape, bad)
    for name, picture in alone.passes.items():
        assert np.array_equal(picture.view(np.uint32), with_bad.passes[name].view(np.uint32)), f"row {row}: {name}"
    assert alone.passes["Combined"][..., :3].max() > 0.1


@every_shape
@pytest.mark.parametrize("kind", ["BVH", "KD_TREE", "HIERARCHICAL_GRID"])
def test_row_23_points_that_coincide_are_no_trouble(shape: str, kind: str) -> None:
    """Standing still for a while, turning back on themselves, all in one place."""
    stands = [[-1, 1, 0, 0.1], [0, 1, 0, 0.1], [0, 1, 0, 0.1], [0, 1, 0, 0.1], [1, 1.2, 0, 0.1]]
    back = [[-1, -1, 0, 0.1], [1, -1, 0, 0.1], [-1, -1, 0, 0.1]]
    scene = scene_of(strands(GOOD, stands, back, [[0.3, 0.9, 1, 0.1]] * 4), clear_fibre, shape=shape, world=1.0)
    scene.settings.accelerator = kind
    picture = rendered(scene).passes["Combined"]
    assert picture[..., 3].max() == 1.0
    # A fibre that absorbs nothing shows the even world around it, wherever its light comes from.
    np.testing.assert_allclose(picture[..., :3], 1.0, atol=0.05)


@every_shape
def test_row_25_points_as_far_as_rays_reach_are_drawn(shape: str) -> None:
    result = beside(shape, [[-1e12, 0, -5, 2.0], [1e12, 0, -5, 2.0]])
    assert result.stats["dropped_curve_pieces"] == 0
    assert (result.passes["Combined"][..., 3] == 1.0).all()
    rendered(scene_of(strands(GOOD, [[-1e30, 0, 0, 0.3], [1e30, 0, 0, 0.3]]), shape=shape))


@every_shape
def test_row_31_strands_in_one_place_make_no_larger_tree(shape: str) -> None:
    rng = np.random.default_rng(31)
    copies = 3000
    spread = np.array(GOOD)[None] + np.concatenate([rng.uniform(-1, 1, (copies, 1, 3)), np.zeros((copies, 1, 1))], 2)
    same = rendered(scene_of(strands(*[GOOD] * copies), shape=shape, size=8))
    other = rendered(scene_of(strands(*spread), shape=shape, size=8))
    assert same.stats["structure_nodes"] <= 3 * other.stats["structure_nodes"]
    one = rendered(scene_of(strands(GOOD), shape=shape, size=8))
    assert np.array_equal(one.passes["Depth"], same.passes["Depth"])

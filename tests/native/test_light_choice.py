"""Emissive triangles, the world and the choice among many emitters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from support.lights import (
    IDENTITY,
    TRIANGLE,
    WORLD,
    contributions,
    irradiance,
    look_down,
    mesh_light,
    numbers,
    polygon_irradiance,
    rows,
    sphere_directions,
)

UP = (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)


def quad_lights(count: int, seed: int = 5, **rest: Any) -> Any:
    """`count` separate small quads all over a cube of 10 m, emitting on one side, of unequal strength."""
    rng = np.random.default_rng(seed)
    corner = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 0.1
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    positions = (corner @ turns.transpose(0, 2, 1) + rng.uniform(-5, 5, (count, 1, 3))).reshape(-1, 3)
    base = 4 * np.arange(count)[:, None, None]
    triangles = (base + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    mesh = {"positions": positions.astype(np.float32), "triangles": triangles.astype(np.uint32), "emission_sampling": 1}
    return core.light.TestLights(meshes=[mesh], instances=[{"matrix": IDENTITY, "mesh": 0}], **rest)


@pytest.mark.parametrize(("side", "lit"), [(1, "below"), (2, "above"), (3, "both")])
@pytest.mark.parametrize("mirrored", [False, True])
def test_triangles_light_the_side_that_their_material_samples(side: int, lit: str, mirrored: bool) -> None:
    sign = -1.0 if mirrored else 1.0
    # Seen from below the corners run clockwise about +z reversed: the front faces -z.
    mesh = {"positions": np.array([[0, 0, 1], [0, 1, 1], [1, 0, 1]], np.float32) * [sign, 1, 1],
            "triangles": np.array([[0, 1, 2]], np.uint32), "emission_sampling": side}  # fmt: skip
    matrix = [sign, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
    lights = core.light.TestLights(meshes=[mesh], instances=[{"matrix": matrix, "mesh": 0, "mirrored": mirrored}])
    above = irradiance(lights, (0.2, 0.2, 2.0), (0.0, 0.0, -1.0), 64)
    below = irradiance(lights, (0.2, 0.2, 0.0), UP, 64)
    flips = mirrored  # the mesh itself was mirrored too: its own front now faces +z before the instance
    expect_below = lit == "both" or (lit == "below") != flips
    expect_above = lit == "both" or (lit == "above") != flips
    assert (below > 0) == expect_below
    assert (above > 0) == expect_above


@pytest.mark.parametrize(
    "positions", [[[0, 0, 1]] * 3, [[0, 0, 1], [1, 0, 1], [2, 0, 1]], [[math.nan, 0, 1], [1, 0, 1], [0, 1, 1]]]
)
def test_triangles_without_area_or_finite_corners_are_no_lights(positions: Any) -> None:
    good = [[3, 0, 2], [4, 0, 2], [3, 1, 2]]
    lights = mesh_light(positions + good, [[0, 1, 2], [3, 4, 5]])
    alone = mesh_light(good)
    assert lights.counts()["emitters"] == 1
    assert irradiance(lights, ORIGIN, UP) == pytest.approx(irradiance(alone, ORIGIN, UP), rel=1e-6)


@pytest.mark.parametrize("transmits", [False, True])
@pytest.mark.parametrize("normal", [UP, (0.6, 0.0, -0.8), ORIGIN])
@pytest.mark.parametrize("tree", [True, False])
def test_density_of_a_found_triangle_is_that_of_sampling_it(transmits: bool, normal: Any, tree: bool) -> None:
    lights = quad_lights(300, light_tree=tree, world={"radiance": [0.5, 0.5, 0.5]},
                         lamps=[{"shape": "SUN", "matrix": look_down(), "power": 3.0, "angle": 0.1}])  # fmt: skip
    count = 1 << 13
    p, n = rows((0.3, 0.2, -0.4), count), rows(normal, count)
    s = lights.sample(p, n, transmits, numbers(count))
    found = s["kind"] == TRIANGLE
    assert found.sum() > 100
    pdf = lights.pdf_triangle(p[found], n[found], transmits, s["instance"][found], s["prim"][found],
                              s["direction"][found], s["distance"][found])  # fmt: skip
    np.testing.assert_allclose(pdf, s["pdf"][found], rtol=1e-3)


def test_shares_of_all_triangles_and_the_world_sum_to_one() -> None:
    """Selection frequency of every emitter equals the probability that the density query implies."""
    lights = quad_lights(64, world={"radiance": [0.5, 0.5, 0.5]})
    count = 1 << 16
    p, n = rows((12.0, 0.0, 0.0), count), rows(ORIGIN, count)
    s = lights.sample(p, n, False, numbers(count))
    by_area = 0.02  # each triangle is narrow: its own density is d^2 / (cos area)
    cosine = np.abs((s["direction"] * s["normal"]).sum(1))
    of_world = s["kind"] == WORLD
    used = s["kind"] != 0
    distance = np.where(used & ~of_world, s["distance"], 1.0)
    implied = np.where(of_world, s["pdf"] * 4 * math.pi, s["pdf"] * cosine * by_area / distance**2)
    prim = np.where(of_world, 128, s["prim"])
    frequency = np.bincount(prim[used], minlength=129) / count
    share = np.zeros(129)
    share[prim[used]] = implied[used]
    chosen = frequency > 0.002
    np.testing.assert_allclose(frequency[chosen], share[chosen], atol=6e-4, rtol=0.05)


@pytest.mark.parametrize("normal", [UP, (0.6, 0.0, -0.8)])
def test_the_tree_finds_all_light_of_many_emitters(normal: Any) -> None:
    """The sum over emitters, one by one, equals what the tree samples: nothing that shines here is never chosen."""
    tree, even = quad_lights(500), quad_lights(500, light_tree=False)
    for p in ((0.3, 0.2, -0.4), (4.9, -4.9, 4.9), (12.0, 0.0, 0.0)):
        truth = irradiance(even, p, normal, 1 << 19)
        assert irradiance(tree, p, normal, 1 << 16) == pytest.approx(truth, rel=0.02)


def test_a_thousand_lamps_are_chosen_five_times_better_than_evenly() -> None:
    rng = np.random.default_rng(8)
    lamps = [{"shape": "POINT", "matrix": look_down(*rng.uniform(-10, 10, 3)), "radius": 0.05} for _ in range(1024)]
    tree = core.light.TestLights(lamps=lamps)
    even = core.light.TestLights(lamps=lamps, light_tree=False)
    ratios = []
    for p in rng.uniform(-9, 9, (20, 3)):
        a, b = contributions(tree, p, UP, 1 << 12), contributions(even, p, UP, 1 << 14)
        assert a.mean() == pytest.approx(b.mean(), rel=0.5)
        ratios.append((b.std() / b.mean()) / (a.std() / a.mean()))
    assert np.median(ratios) > 5  # 6.5 measured: forty times fewer samples for the same noise


def test_a_hot_texel_is_sampled_in_proportion_to_its_tent() -> None:
    picture = np.full((64, 128, 3), 1.0, np.float32)
    picture[45, 20] = 1e7
    lights = core.light.TestLights(world={"map": picture})
    count = 1 << 14
    s = lights.sample(rows(ORIGIN, count), rows(ORIGIN, count), False, numbers(count))
    d = s["direction"].astype(float)
    x = (0.5 - np.arctan2(d[:, 1], d[:, 0]) / (2 * math.pi)) * 128 - 0.5
    y = (0.5 + np.arcsin(d[:, 2]) / math.pi) * 64 - 0.5
    tent = np.clip(1 - np.abs(x - 20), 0, 1) * np.clip(1 - np.abs(y - 45), 0, 1)
    weight = (1 + (1e7 - 1) * tent) / s["pdf"]  # what an image lookup would give, over the density
    assert weight.std() / weight.mean() < 0.05


@pytest.mark.parametrize("value", [0.0, math.nan, math.inf, -1.0])
@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 2), (8, 16)])
def test_black_broken_and_tiny_worlds_stay_finite(value: float, shape: tuple[int, int]) -> None:
    picture = np.full((*shape, 3), 0.5, np.float32)
    picture[0, 0] = value
    lights = core.light.TestLights(world={"map": picture})
    d = sphere_directions(1 << 10)
    pdf = lights.pdf_world(rows(ORIGIN, len(d)), rows(UP, len(d)), False, d)
    assert np.isfinite(pdf).all()
    s = lights.sample(rows(ORIGIN, len(d)), rows(UP, len(d)), False, numbers(len(d)))
    used = s["kind"] == WORLD
    assert np.isfinite(s["direction"][used]).all() and (s["pdf"][used] > 0).all()
    black = shape == (1, 1) and value != -1.0
    assert used.all() != black


def test_sun_below_the_horizon_gives_way_to_the_lamps() -> None:
    up = [1.0, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0]
    lamps = [{"shape": "SUN", "matrix": up, "power": 1e6}, {"shape": "POINT", "matrix": look_down(z=2.0), "power": 1.0}]
    lights = core.light.TestLights(lamps=lamps)
    s = lights.sample(rows(ORIGIN, 256), rows(UP, 256), False, numbers(256))
    assert (s["lamp"] == 1).all()
    assert s["pdf"] == pytest.approx(1.0)


def test_ten_thousand_nearly_identical_triangles_build_a_bounded_tree() -> None:
    triangle = [[0, 0, 1], [1, 0, 1], [0, 1, 1]]
    # Two units in the last place apart: all centres fall into one bin, yet no two lie in one place.
    corners = [[x, y, z + 2.4e-7 * i] for i in range(10_000) for x, y, z in triangle]
    lights = mesh_light(corners, [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(10_000)])
    assert lights.counts()["emitters"] == 10_000
    assert lights.counts()["nodes"] < 2_000
    truth = 10_000 * polygon_irradiance(triangle, (0.2, 0.2, 0.0), UP)
    assert irradiance(lights, (0.2, 0.2, 0.0), UP) == pytest.approx(truth, rel=0.01)


def test_identical_triangles_are_one_light() -> None:
    triangle = [[0, 0, 1], [1, 0, 1], [0, 1, 1]]
    lights = mesh_light(triangle, [[0, 1, 2]] * 100 + [[2, 1, 0]] * 100)
    assert lights.counts()["emitters"] == 1
    truth = polygon_irradiance(triangle, (0.2, 0.2, 0.0), UP)
    assert irradiance(lights, (0.2, 0.2, 0.0), UP) == pytest.approx(truth, rel=0.01)


def test_a_closed_emissive_mesh_is_sampled_on_its_outside_only() -> None:
    corners = [[x, y, z] for z in (2, 3) for y in (0, 1) for x in (0, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]  # normals outward
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    for inside_out in (False, True):
        lights = mesh_light(corners, [t[::-1] for t in triangles] if inside_out else triangles)
        s = lights.sample(rows(ORIGIN, 256), rows(UP, 256), False, numbers(256))
        assert set(s["prim"][s["kind"] == TRIANGLE]) == {0, 1}  # of the six faces the bottom one alone is seen
        truth = polygon_irradiance([corners[i] for i in (0, 2, 3, 1)], ORIGIN, UP)
        assert irradiance(lights, ORIGIN, UP) == pytest.approx(truth, rel=1e-3)
    opened = mesh_light(corners, triangles[:-1])
    s = opened.sample(rows(ORIGIN, 256), rows(UP, 256), False, numbers(256))
    assert len(set(s["prim"][s["kind"] == TRIANGLE])) > 2


def test_instances_beyond_the_bound_are_one_emitter_each_and_give_the_same_light() -> None:
    rng = np.random.default_rng(6)
    mesh = {
        "positions": rng.uniform(-0.2, 0.2, (30, 3)).astype(np.float32),
        "triangles": np.arange(30, dtype=np.uint32).reshape(10, 3),
        "emission_sampling": 3,
    }
    instances = []
    for x, y, z in rng.uniform(-3, 3, (40, 3)):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.5, 2.0, 3)
        matrix = np.hstack([turn, [[x], [y], [z + 5]]])
        instances.append({"matrix": matrix.ravel().tolist(), "mesh": 0, "mirrored": bool(np.linalg.det(turn) < 0)})
    each = core.light.TestLights(meshes=[mesh], instances=instances)
    whole = core.light.TestLights(meshes=[mesh], instances=instances, most_triangles=100)
    assert (each.counts()["emitters"], whole.counts()["emitters"]) == (400, 40)
    truth = irradiance(each, ORIGIN, UP, 1 << 15)
    assert irradiance(whole, ORIGIN, UP, 1 << 17) == pytest.approx(truth, rel=0.01)
    s = whole.sample(rows(ORIGIN, 256), rows(UP, 256), False, numbers(256))
    k = s["kind"] == TRIANGLE
    pdf = whole.pdf_triangle(rows(ORIGIN, 256)[k], rows(UP, 256)[k], False, s["instance"][k], s["prim"][k],
                             s["direction"][k], s["distance"][k])  # fmt: skip
    np.testing.assert_allclose(pdf, s["pdf"][k], rtol=1e-3)

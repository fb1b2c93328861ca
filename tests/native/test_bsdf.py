"""Closures keep their promises: what they send, to whom, and that nothing breaks at the ends of the ranges."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CAMERA, BACKFACING, DIFFUSE_RAY, EMISSION_ONLY = 1, 512, 4, 256
COUNT = 1 << 15
GRAZING = (0.0, 60.0, 85.0, 89.5)  # degrees
ROUGHNESS = (0.0, 1e-6, 1e-3, 0.05, 0.2, 0.5, 0.8, 1.0)


def closures(node: str, inputs: dict[str, Any], degrees: float = 30.0, **context: Any) -> Any:
    """The node's closures on the plane z = 0, seen from the given angle in the xz plane."""
    angle = math.radians(degrees)
    return core.bsdf.Closures(node, inputs, wo=(math.sin(angle), 0.0, math.cos(angle)), **context)


def lattice(count: int = COUNT) -> NDArray[np.float32]:
    """Low-discrepancy points of the unit cube, (count, 3)."""
    i = np.arange(count) + 0.5
    steps = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
    return np.minimum(np.stack([(i * s) % 1.0 for s in steps], axis=1), 0.99999994).astype(np.float32)


def reflectance(c: Any, count: int = COUNT) -> Floats:
    """What the closures send of a white world, (3,)."""
    return np.asarray(c.sample(lattice(count))["throughput"], dtype=float).mean(axis=0)


def hemisphere(count: int, seed: int) -> Floats:
    random = np.random.default_rng(seed)
    z = random.random(count)
    phi, r = 2.0 * np.pi * random.random(count), np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_white_closures_return_what_they_receive(roughness: float, degrees: float) -> None:
    white = {"color": 1.0, "roughness": roughness}
    for node in ("glossy", "glass"):
        got = reflectance(closures(node, white, degrees))
        # The tables have 32 (16) steps: between the last of them, at grazing angles, lobes are off.
        step = 0.05 if degrees > 89.0 else (0.02 if node == "glass" or roughness < 0.2 else 0.004)
        assert np.all(np.abs(got - 1.0) <= step), (node, got)
    metal = {"base_color": 1.0, "edge_tint": 1.0, "roughness": roughness}
    assert np.all(np.abs(reflectance(closures("metallic", metal, degrees)) - 1.0) <= 0.05)


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_principled_white_dielectric_is_near_white(roughness: float, degrees: float) -> None:
    got = reflectance(closures("principled", {"base_color": 1.0, "roughness": roughness}, degrees))
    tolerance = 0.01 if degrees <= 60.0 else 0.05  # the layering is an estimate, as in Cycles
    assert np.all(np.abs(got - 1.0) <= tolerance), got


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", (0.0, 0.3, 1.0))
def test_oren_nayar_is_white_at_every_roughness(roughness: float, degrees: float) -> None:
    got = reflectance(closures("diffuse", {"color": 1.0, "roughness": roughness}, degrees))
    assert np.all(np.abs(got - 1.0) <= (2e-3 if degrees <= 85.0 else 5e-3)), got  # few samples meet the bright rim


LOSSY: list[tuple[str, dict[str, Any]]] = [
    ("glossy", {"color": 1.0, "distribution": "GGX"}),
    ("glossy", {"color": 1.0, "distribution": "BECKMANN"}),
    ("glossy", {"color": 1.0, "distribution": "ASHIKHMIN_SHIRLEY"}),
    ("glass", {"distribution": "GGX"}),
    ("glass", {"distribution": "BECKMANN"}),
    ("refraction", {"distribution": "GGX"}),
    ("sheen", {}),
    ("metallic", {"physical": True, "thin_film_thickness": 300.0}),
]


@pytest.mark.parametrize(("node", "inputs"), LOSSY)
def test_no_closure_sends_more_than_it_receives(node: str, inputs: dict[str, Any]) -> None:
    for roughness in ROUGHNESS:
        for degrees in GRAZING:
            got = reflectance(closures(node, {**inputs, "roughness": roughness}, degrees), 1 << 13)
            assert np.all(got <= 1.002), (roughness, degrees, got)


# Not reciprocal by their models, as in Blender: what GGX loses is given back by the direction seen from (MULTI_GGX),
# sheen by a fitted lobe, toon, and what lies under a layer.
RECIPROCAL: list[tuple[str, dict[str, Any], int]] = [  # node, inputs, the side that b lies on
    ("diffuse", {"roughness": 0.0}, 1),
    ("diffuse", {"roughness": 0.8}, 1),
    ("translucent", {}, -1),
    ("glossy", {"distribution": "GGX", "roughness": 0.4}, 1),
    ("glossy", {"distribution": "GGX", "roughness": 0.6, "anisotropy": 0.6, "tangent": (1.0, 0.3, 0.0)}, 1),
    ("glossy", {"distribution": "BECKMANN", "roughness": 0.5}, 1),
    ("glossy", {"distribution": "BECKMANN", "roughness": 0.6, "anisotropy": -0.4, "tangent": (1.0, 0.3, 0.0)}, 1),
    ("glossy", {"distribution": "ASHIKHMIN_SHIRLEY", "roughness": 0.5}, 1),
    (
        "glossy",
        {"distribution": "ASHIKHMIN_SHIRLEY", "roughness": 0.6, "anisotropy": 0.5, "tangent": (1.0, 0.3, 0.0)},
        1,
    ),
    ("glass", {"distribution": "GGX", "roughness": 0.5, "thin_film_thickness": 400.0}, 1),
    ("metallic", {"distribution": "GGX", "physical": True}, 1),
    ("metallic", {"distribution": "GGX", "thin_film_thickness": 300.0}, 1),
    ("velvet", {"roughness": 0.5}, 1),
]


def rounding(p: Floats, q: Floats) -> float:
    """Relative error that single precision leaves: facets that both directions graze have a cosine c with an error of
    some EPS, and Fresnel's root of it is of c^2.
    """
    half = p + q
    cosine = float(p @ half) / max(float(np.linalg.norm(half)), 1e-6)
    return 8.0 * 2.0**-24 / max(cosine * cosine, 1e-6)


SMALLEST_COSINE = 1e-6  # of math/bounds.h
PAIRS = pytest.mark.parametrize("pairs", [500, pytest.param(100_000, marks=pytest.mark.full)])


@PAIRS
@pytest.mark.parametrize(("node", "inputs", "side"), RECIPROCAL)
def test_reflection_is_reciprocal(node: str, inputs: dict[str, Any], side: int, pairs: int) -> None:
    turn = np.array([1.0, 1.0, float(side)])  # from the far side, the surface is turned to the ray
    flags = CAMERA if side > 0 else CAMERA | BACKFACING
    compared = 0
    for p, q in zip(hemisphere(pairs, 1), hemisphere(pairs, 2) * turn, strict=True):
        there = core.bsdf.Closures(node, inputs, wo=tuple(p)).eval(q[None].astype(np.float32))[0].sum(axis=1)[0]
        back = core.bsdf.Closures(node, inputs, wo=tuple(q * turn), path_flags=flags)
        f, g = there / abs(q[2]), back.eval((p * turn)[None].astype(np.float32))[0].sum(axis=1)[0] / p[2]
        if f[0] > 1e-3 and min(p[2], abs(q[2])) >= SMALLEST_COSINE:
            compared += 1
            assert np.all(np.abs(f - g) <= (1e-4 + rounding(p, q)) * f), (p, q, f, g)
    assert compared > 0.16 * pairs


@PAIRS
def test_refraction_is_reciprocal_but_for_the_squared_index(pairs: int) -> None:
    inputs = {"roughness": 0.5, "distribution": "GGX", "ior": 1.5}
    above, below = hemisphere(2 * pairs, 3), -hemisphere(2 * pairs, 4)
    compared = 0
    for p, q in zip(above, below, strict=True):
        enter = core.bsdf.Closures("glass", inputs, wo=tuple(p)).eval(q[None].astype(np.float32))[0].sum(axis=1)[0]
        flip = np.array([1.0, 1.0, -1.0])  # inside, the surface is turned to the ray
        leave = core.bsdf.Closures("glass", inputs, wo=tuple(q * flip), path_flags=CAMERA | BACKFACING)
        leave = leave.eval((p * flip)[None].astype(np.float32))[0].sum(axis=1)[0]
        f, g = enter / -q[2], leave / p[2] * 1.5**2
        if f[0] > 1e-3:
            compared += 1
            assert np.all(np.abs(f - g) <= (1e-4 + rounding(p, 1.5 * q)) * f), (p, q, f, g)
    assert compared > 0.2 * pairs


@pytest.mark.parametrize("node", ["glossy", "glass", "metallic", "refraction"])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 80.0])
def test_tiny_roughness_is_roughness_zero(node: str, degrees: float) -> None:
    smooth = closures(node, {"roughness": 0.0}, degrees).sample(lattice(4096))
    for roughness in (1e-6, 1e-3):
        drawn = closures(node, {"roughness": roughness}, degrees).sample(lattice(4096))
        assert np.all(drawn["delta"] == smooth["delta"])
        assert np.abs(drawn["direction"] - smooth["direction"]).max() <= 1e-5
        assert np.abs(drawn["throughput"] - smooth["throughput"]).max() <= 1e-3


def test_roughness_above_the_mirror_threshold_continues_the_mirror() -> None:
    for degrees in (0.0, 45.0, 80.0):
        mirror = reflectance(closures("glossy", {"roughness": 0.0, "color": 1.0}, degrees))
        sharp = closures("glossy", {"roughness": 4e-3, "color": 1.0}, degrees).sample(lattice())
        assert not sharp["delta"].any()
        assert np.all(sharp["pdf"] > 0.0)
        # The mirrored view lies at -x; alpha is 1.6e-5, the farthest of 2^15 slopes some 200 times that.
        angle = math.radians(degrees)
        away = np.linalg.norm(sharp["direction"] - np.array([-math.sin(angle), 0.0, math.cos(angle)]), axis=1)
        assert np.median(away) < 2e-4
        assert np.abs(sharp["throughput"].mean(axis=0) - mirror).max() <= 2e-3


@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_index_one_is_invisible(roughness: float) -> None:
    for node in ("glass", "principled"):
        inputs = {"ior": 1.0, "roughness": roughness}
        if node == "principled":
            inputs |= {"transmission_weight": 1.0, "base_color": 1.0}
        drawn = closures(node, inputs, 50.0).sample(lattice())
        assert drawn["transmitted"].all() and drawn["delta"].all()
        angle = math.radians(50.0)
        straight = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
        assert np.abs(drawn["direction"] - straight).max() <= 1e-6
        assert np.abs(drawn["throughput"] - 1.0).max() <= 1e-3


@pytest.mark.parametrize("roughness", [0.0, 0.3])
@pytest.mark.parametrize("flags", [CAMERA, CAMERA | BACKFACING])
@pytest.mark.parametrize("ior", [0.0, 1e-3, 0.5, 0.9999, 1.00005, 1.0001, 1.001, 10.0, 1e6, math.inf, math.nan])
def test_any_index_stays_finite_and_keeps_energy(ior: float, flags: int, roughness: float) -> None:
    for degrees in GRAZING:
        c = closures("glass", {"ior": ior, "roughness": roughness, "distribution": "GGX"}, degrees, path_flags=flags)
        drawn = c.sample(lattice(2048))
        assert np.isfinite(drawn["throughput"]).all() and np.isfinite(drawn["direction"]).all()
        assert drawn["throughput"].mean() <= 1.001


def test_closures_are_continuous_in_the_index() -> None:
    """Light that glass bends away from straight through falls with |IOR - 1|."""
    angle = math.radians(40.0)
    straight = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    for ior in (0.999, 0.9999, 1.0001, 1.001):
        drawn = closures("glass", {"ior": ior, "roughness": 0.3, "distribution": "GGX"}, 40.0).sample(lattice())
        bent = np.linalg.norm(drawn["direction"] - straight, axis=1)
        assert math.sqrt(np.mean(np.minimum(bent, 2.0) ** 2)) <= 20.0 * abs(ior - 1.0) + 1e-3


CHANGING: list[tuple[str, str, dict[str, Any]]] = [
    ("diffuse", "roughness", {}),
    ("glossy", "roughness", {"distribution": "GGX"}),
    ("glossy", "roughness", {"distribution": "BECKMANN"}),
    ("glossy", "roughness", {"distribution": "ASHIKHMIN_SHIRLEY"}),
    ("glossy", "roughness", {"distribution": "MULTI_GGX"}),
    ("glossy", "anisotropy", {"distribution": "GGX", "roughness": 0.4, "tangent": (1.0, 0.3, 0.0)}),
    ("glass", "roughness", {}),
    ("glass", "ior", {"roughness": 0.3}),
    ("glass", "thin_film_thickness", {"roughness": 0.3}),
    ("refraction", "roughness", {"distribution": "GGX"}),
    ("refraction", "ior", {"distribution": "GGX", "roughness": 0.3}),
    ("metallic", "roughness", {}),
    ("metallic", "thin_film_thickness", {"roughness": 0.3}),
    ("sheen", "roughness", {}),
    ("velvet", "roughness", {}),
    ("toon", "size", {"smooth": 0.2}),
    ("toon", "smooth", {"size": 0.3}),
    ("toon", "size", {"smooth": 0.2, "glossy": True}),
    ("translucent", "color", {}),
    ("principled", "roughness", {"thin_wall": True, "transmission_weight": 1.0}),
    *[("principled", name, {"coat_weight": 0.5, "sheen_weight": 0.5, "transmission_weight": 0.3, "metallic": 0.2})
      for name in ("roughness", "diffuse_roughness", "coat_roughness", "sheen_roughness", "ior", "coat_ior")],
]  # fmt: skip
RANGES = {"ior": (0.4, 2.6), "coat_ior": (1.0, 2.6), "thin_film_thickness": (0.0, 600.0), "anisotropy": (-0.9, 0.9)}


@pytest.mark.parametrize("degrees", [20.0, 75.0])
@pytest.mark.parametrize(("node", "name", "inputs"), CHANGING)
def test_closures_are_continuous(node: str, name: str, inputs: dict[str, Any], degrees: float) -> None:
    """How much light goes where, by its first moments: the largest change between neighbours of a grid is halved until
    it is small, which a jump never is."""
    draws = lattice(4096)

    def moments(value: float) -> Floats:
        drawn = closures(node, {**inputs, name: value}, degrees).sample(draws)
        light = drawn["throughput"].astype(float).mean(axis=1, keepdims=True)
        return np.asarray(np.concatenate([light, light * drawn["direction"]], axis=1).mean(axis=0))

    low, high = RANGES.get(name, (0.0, 1.0))
    grid = np.linspace(low, high, 24)
    at_grid = [moments(float(value)) for value in grid]
    steps = [float(np.abs(b - a).max()) for a, b in itertools.pairwise(at_grid)]
    first = int(np.argmax(steps))
    assert steps[first] > 1e-5, "nothing changes: the input is not read"
    a, b = float(grid[first]), float(grid[first + 1])
    at_a, at_b = at_grid[first], at_grid[first + 1]
    for _ in range(10):
        middle = 0.5 * (a + b)
        at_middle = moments(middle)
        if np.abs(at_middle - at_a).max() > np.abs(at_b - at_middle).max():
            b, at_b = middle, at_middle
        else:
            a, at_a = middle, at_middle
    assert np.abs(at_b - at_a).max() <= 4e-3, (a, b, at_a, at_b)  # at the critical angle it is the steepest


def test_hostile_inputs_never_make_a_lobe_that_is_not_a_number() -> None:
    bad = (math.nan, math.inf, -math.inf, -1.0, 1e30, 1e-30)
    names = ("base_color", "metallic", "roughness", "ior", "alpha", "specular_ior_level", "coat_weight", "coat_ior")
    names += ("sheen_weight", "transmission_weight", "thin_film_thickness", "diffuse_roughness", "coat_roughness")
    for name in names:
        for value in bad:
            for degrees in (0.0, 89.99):
                inputs = {"coat_weight": 0.5, "sheen_weight": 0.5, "transmission_weight": 0.5, "metallic": 0.3}
                c = closures("principled", inputs | {name: value}, degrees)
                drawn = c.sample(lattice(256))
                assert not np.isnan(drawn["throughput"]).any(), (name, value)
                assert not np.isnan(drawn["direction"]).any(), (name, value)
                light, pdf = c.eval(np.concatenate([hemisphere(64, 5), -hemisphere(64, 6)]).astype(np.float32))
                assert not np.isnan(light).any() and not np.isnan(pdf).any(), (name, value)


def test_a_full_list_keeps_its_strongest_lobes() -> None:
    c = closures("diffuse", {"color": 0.01})
    assert c.limit_lobes(40) == 12
    kept = np.array(c.albedo()[0])
    # 12 lobes fit: 1, 1/2, ... 1/12; the first, of 0.01, and all weaker ones gave way.
    assert kept[0] == pytest.approx(sum(1.0 / (i + 1) for i in range(12)), rel=1e-5)


def test_caustics_switches_act_after_a_diffuse_bounce_only() -> None:
    for flags, expected in ((CAMERA, 1), (DIFFUSE_RAY, 0)):
        c = closures("glossy", {"roughness": 0.2}, caustics_reflective=False, path_flags=flags)
        assert c.count == expected
    c = closures("glass", {}, caustics_refractive=False, path_flags=DIFFUSE_RAY)
    assert not c.sample(lattice(512))["transmitted"].any()


def test_emission_lies_under_coat_and_sheen() -> None:
    bare = closures("principled", {"emission_strength": 2.0}, path_flags=EMISSION_ONLY)
    assert bare.count == 0
    assert bare.emission == pytest.approx((2.0, 2.0, 2.0))
    coated = closures("principled", {"emission_strength": 2.0, "coat_weight": 1.0, "coat_tint": (0.5, 1.0, 1.0)})
    assert coated.emission[0] < 0.5 * coated.emission[1] < 1.0


def test_alpha_is_transparency() -> None:
    c = closures("principled", {"alpha": 0.25, "base_color": 1.0})
    assert c.transparent == pytest.approx((0.75, 0.75, 0.75))
    assert np.array(c.albedo()).sum(axis=0) == pytest.approx(np.full(3, 0.25), abs=2e-3)


def test_bumped_reflections_stay_above_the_surface() -> None:
    """A normal tilted away from the viewer is lifted until its mirror direction leaves the surface."""
    for tilt in np.linspace(-85.0, 85.0, 35):
        t = math.radians(tilt)
        c = closures("glossy", {"roughness": 0.0, "normal": (math.sin(t), 0.0, math.cos(t))}, 70.0)
        drawn = c.sample(lattice(16))
        assert (drawn["pdf"] > 0.0).all()
        assert (drawn["direction"][:, 2] > 0.0).all()


def test_light_does_not_leak_through_a_bumped_surface() -> None:
    c = closures("diffuse", {"normal": (0.9, 0.0, 0.4)}, 30.0)
    behind = np.array([[0.95, 0.0, -0.3]], dtype=np.float32)  # before the bumped normal, behind the surface
    behind /= np.linalg.norm(behind)
    assert c.eval(behind)[0].max() == 0.0


def test_filter_glossy_blurs_sharp_lobes() -> None:
    c = closures("glossy", {"roughness": 0.0})
    assert c.sample(lattice(16))["delta"].all()
    c.blur(0.25)
    drawn = c.sample(lattice(16))
    assert not drawn["delta"].any()
    assert drawn["roughness"] == pytest.approx(0.25)


def test_only_blurred_glass_counts_facets_seen_from_behind() -> None:
    """As Cycles draws Filter Glossy; a lobe that is rough by itself sends no such light."""
    wo = (math.sin(1.3), 0.0, math.cos(1.3))
    beyond = np.array([[0.995, 0.0, -0.0998]], np.float32)  # no facet bends the view that far back
    blurred = core.bsdf.Closures("glass", {"roughness": 0.0, "distribution": "GGX"}, wo=wo)
    blurred.blur(0.25)
    rough = core.bsdf.Closures("glass", {"roughness": 0.5, "distribution": "GGX"}, wo=wo)
    assert rough.eval(beyond)[0].sum() == 0.0
    assert blurred.eval(beyond)[0].sum() > 0.0


def test_a_misspelt_input_is_an_error() -> None:
    with pytest.raises(ValueError, match="rougness"):
        closures("glossy", {"rougness": 0.1})

"""Closures at their limits, without a picture: what they send, to whom, and that nothing breaks. Numbers: the rows of the
list of hard cases. Renders of the same stand in test_surfaces.py, densities in test_closure_samples.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from support.closures import (
    BACKFACING,
    CAMERA,
    GRAZING,
    ROUGHNESS,
    Floats,
    closures,
    hemisphere,
    lattice,
    reflectance,
)


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_38_white_closures_return_what_they_receive(roughness: float, degrees: float) -> None:
    white = {"color": 1.0, "roughness": roughness}
    metal = {"base_color": 1.0, "edge_tint": 1.0, "roughness": roughness}
    for node, inputs in (("glossy", white), ("metallic", metal), ("glass", white)):
        got = reflectance(closures(node, inputs, degrees))
        # The tables have 32 (16) steps: between the last of them, at grazing angles, lobes are off.
        step = (0.05 if node == "glass" else 0.04) if degrees > 89.0 else (0.01 if node == "glass" else 2e-3)
        assert np.all(np.abs(got - 1.0) <= step), (node, got)
        assert got.max() <= (1.004 if node == "glass" else 1.002), (node, got)


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_38_principled_white_dielectric_is_near_white(roughness: float, degrees: float) -> None:
    got = reflectance(closures("principled", {"base_color": 1.0, "roughness": roughness}, degrees))
    assert np.all(np.abs(got - 1.0) <= 0.01), got  # the layering is an estimate, as in Cycles


@pytest.mark.parametrize("degrees", GRAZING)
@pytest.mark.parametrize("roughness", (0.0, 0.3, 1.0))
def test_38_oren_nayar_is_white_at_every_roughness(roughness: float, degrees: float) -> None:
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
def test_38_no_closure_sends_more_than_it_receives(node: str, inputs: dict[str, Any]) -> None:
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
def test_40_reflection_is_reciprocal(node: str, inputs: dict[str, Any], side: int, pairs: int) -> None:
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
def test_40_refraction_is_reciprocal_but_for_the_squared_index(pairs: int) -> None:
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


@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_42_index_one_is_invisible(roughness: float) -> None:
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
def test_42_any_index_stays_finite_and_keeps_energy(ior: float, flags: int, roughness: float) -> None:
    for degrees in GRAZING:
        c = closures("glass", {"ior": ior, "roughness": roughness, "distribution": "GGX"}, degrees, path_flags=flags)
        drawn = c.sample(lattice(2048))
        assert np.isfinite(drawn["throughput"]).all() and np.isfinite(drawn["direction"]).all()
        assert drawn["throughput"].mean() <= 1.001


def test_42_closures_are_continuous_in_the_index() -> None:
    """Light that glass bends away from straight through falls with |IOR - 1|."""
    angle = math.radians(40.0)
    straight = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    for ior in (0.999, 0.9999, 1.0001, 1.001):
        drawn = closures("glass", {"ior": ior, "roughness": 0.3, "distribution": "GGX"}, 40.0).sample(lattice())
        bent = np.linalg.norm(drawn["direction"] - straight, axis=1)
        assert math.sqrt(np.mean(np.minimum(bent, 2.0) ** 2)) <= 20.0 * abs(ior - 1.0) + 1e-3


@pytest.mark.parametrize("node", ["glossy", "glass", "metallic", "refraction"])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 80.0])
def test_44_tiny_roughness_is_roughness_zero(node: str, degrees: float) -> None:
    smooth = closures(node, {"roughness": 0.0}, degrees).sample(lattice(4096))
    for roughness in (1e-6, 1e-3):
        drawn = closures(node, {"roughness": roughness}, degrees).sample(lattice(4096))
        assert np.all(drawn["delta"] == smooth["delta"])
        assert np.abs(drawn["direction"] - smooth["direction"]).max() <= 1e-5
        assert np.abs(drawn["throughput"] - smooth["throughput"]).max() <= 1e-3


def test_62_arc_functions_take_what_rounding_pushed_out_of_range() -> None:
    x = np.float32([-2, -1.0000001, -1, 1, 1.0000001, 2, -np.inf, np.inf])
    np.testing.assert_allclose(core.math.asin(x), np.arcsin(np.clip(x, -1, 1)), rtol=1e-7)
    np.testing.assert_allclose(core.math.acos(x), np.arccos(np.clip(x, -1, 1)), rtol=1e-7, atol=1e-7)


def test_62_hostile_inputs_never_make_a_lobe_that_is_not_a_number() -> None:
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


EPS = 2.0**-24
COSINES = (1.0, 1.0 - EPS, 1.0 + 2.0 * EPS, -1.0, -1.0 + EPS, -1.0 - 2.0 * EPS, 0.0, -0.0)
LOBES: list[tuple[str, dict[str, Any]]] = [
    *LOSSY,
    *((node, inputs) for node, inputs, _ in RECIPROCAL),
    ("toon", {"size": 0.4, "smooth": 0.3}),
    ("toon", {"size": 0.4, "smooth": 0.3, "glossy": True}),
    ("principled", {"coat_weight": 0.5, "sheen_weight": 0.5, "transmission_weight": 0.5, "metallic": 0.3}),
    ("principled", {"anisotropic": 0.5, "thin_wall": True, "transmission_weight": 0.5, "tangent": (1.0, 0.3, 0.0)}),
    ("hair", {"roughness_along": 0.3, "roughness_around": 0.6}),
    ("principled_hair", {"absorption": 0.5}),
]


@pytest.mark.parametrize("flags", [CAMERA, CAMERA | BACKFACING])
@pytest.mark.parametrize(("node", "inputs"), LOBES)
def test_62_cosines_that_rounding_pushed_past_one_make_light_of_no_broken_sine(
    node: str, inputs: dict[str, Any], flags: int
) -> None:
    """Of the direction seen from, and of those that light comes from; straight up, all but flat, from below."""
    ends = np.float32([(0.0, 0.0, z) for z in COSINES] + [(1.0, 0.0, z) for z in (0.0, 1e-30, -1e-30, EPS, -EPS)])
    for z in (1.0, 1.0 - EPS, 1.0 + 2.0 * EPS, EPS, 1e-30):
        wo = (0.0, 0.0, z) if z > 0.5 else (1.0, 0.0, z)
        c = core.bsdf.Closures(node, inputs, wo=wo, path_flags=flags)
        drawn = c.sample(lattice(128))
        for name in ("throughput", "pdf", "direction"):
            assert np.isfinite(drawn[name]).all(), (z, name)
        assert (drawn["throughput"] >= 0.0).all() and (drawn["pdf"] >= 0.0).all(), z
        light, pdf = c.eval(ends)
        assert np.isfinite(light).all() and np.isfinite(pdf).all(), z
        assert (light >= 0.0).all() and (pdf >= 0.0).all(), z

"""Closures keep their promises: what they send, to whom, and that nothing breaks at the ends of the ranges."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from luch import core
from support.closures import CAMERA, DIFFUSE_RAY, EMISSION_ONLY, Floats, closures, lattice, reflectance


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

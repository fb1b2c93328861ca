"""One lamp: its units against closed forms, its density against its own samples, and its extremes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from support.lights import (
    LAMP,
    LAMPS,
    NOWHERE,
    TURN,
    cone_directions,
    contributions,
    irradiance,
    look_down,
    numbers,
    polygon_irradiance,
    rows,
    sphere_directions,
    store,
)

UP = (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("radius", [0.0, 1e-10, 1e-7, 1e-3])
@pytest.mark.parametrize("soft", [True, False])
def test_point_lamp_of_any_radius_gives_the_flux_over_4_pi_d2(radius: float, soft: bool) -> None:
    lights = store({"shape": "POINT", "matrix": look_down(), "power": 100.0, "radius": radius, "soft_falloff": soft})
    assert irradiance(lights, ORIGIN, UP) * 0.5 / math.pi == pytest.approx(1.2665, rel=1e-3)


@pytest.mark.parametrize("radius", [0.1, 0.5, 0.9])
def test_sphere_lamp_gives_the_closed_form_at_every_distance(radius: float) -> None:
    lights = store({"shape": "POINT", "matrix": look_down(), "power": 100.0, "radius": radius, "soft_falloff": False})
    # A sphere wholly above the horizon: pi L sin^2 of its half angle, L = power / (4 pi^2 r^2).
    assert irradiance(lights, ORIGIN, UP) == pytest.approx(100.0 / (4 * math.pi), rel=5e-4)


@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-2])
@pytest.mark.parametrize("shape", ["SQUARE", "DISK"])
def test_small_area_lamp_gives_the_flux_over_pi_d2(size: float, shape: str) -> None:
    lights = store({"shape": shape, "matrix": look_down(), "power": 100.0, "size": size})
    assert irradiance(lights, ORIGIN, UP) * 0.5 / math.pi == pytest.approx(5.066, rel=2e-3)


def test_endless_area_lamp_gives_pi_times_its_radiance() -> None:
    lights = store({"shape": "SQUARE", "matrix": look_down(), "power": math.pi, "normalize": False, "size": 1e6})
    assert irradiance(lights, ORIGIN, UP) * 0.5 / math.pi == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.00918, 0.5, math.pi])
def test_sun_of_any_angle_gives_its_strength(angle: float) -> None:
    lights = store({"shape": "SUN", "matrix": look_down(), "power": 10.0, "angle": angle})
    assert irradiance(lights, ORIGIN, UP) * 0.5 / math.pi == pytest.approx(1.5915, rel=1e-3)


@pytest.mark.parametrize("size", [0.01, 0.3, 2.0, 50.0])
@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (1.3, -0.4, 0.9), (4.0, 2.0, 0.0)])
def test_square_lamp_gives_lamberts_polygon_formula(size: float, p: tuple[float, float, float]) -> None:
    lights = store({"shape": "SQUARE", "matrix": look_down(), "power": math.pi, "normalize": False, "size": size})
    h = size / 2
    truth = polygon_irradiance([(-h, -h, 1), (h, -h, 1), (h, h, 1), (-h, h, 1)], p, UP)
    assert irradiance(lights, p, UP) == pytest.approx(truth, rel=2e-3)


@pytest.mark.parametrize(("spread", "height"), [(0.3, 1.0), (1.0, 0.5), (2.0, 3.0)])
@pytest.mark.parametrize("shape", ["SQUARE", "DISK"])
def test_spread_keeps_the_flux(spread: float, height: float, shape: str) -> None:
    lamp = {"shape": shape, "matrix": look_down(z=height), "power": 8.0, "size": 0.5, "spread": spread}
    lights = store(lamp)
    reach = height * math.tan(spread / 2) + 0.5
    grid = (np.arange(48) + 0.5) / 48 * 2 * reach - reach
    p = np.stack([*np.meshgrid(grid, grid), np.zeros((48, 48))], -1).reshape(-1, 3).astype(np.float32)
    p = np.repeat(p, 16, axis=0)
    u = np.random.default_rng(1).permuted(numbers(1 << 16)[: len(p)], axis=0)
    s = lights.sample(p, rows(UP, len(p)), False, u)
    used = s["kind"] != 0
    flux = np.where(used, s["radiance"][:, 0] * s["direction"][:, 2] / np.where(used, s["pdf"], 1), 0).mean()
    assert flux * (2 * reach) ** 2 == pytest.approx(8.0, rel=0.02)


def test_no_spread_lights_just_its_own_outline_with_power_over_area() -> None:
    lights = store({"shape": "SQUARE", "matrix": look_down(), "power": 8.0, "size": 2.0, "spread": 0.0})
    assert irradiance(lights, (0.9, 0.9, -5.0), UP) == pytest.approx(2.0, rel=1e-5)
    assert irradiance(lights, (1.1, 0.0, -5.0), UP) == 0.0


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS.keys())
@pytest.mark.parametrize("transmits", [False, True])
def test_a_ray_along_a_sample_finds_the_lamp_its_radiance_and_its_density(
    lamp: dict[str, Any], transmits: bool
) -> None:
    lights = store(lamp | {"matrix": TURN})
    count = 1 << 11
    sun = 0 if lamp["shape"] == "SUN" else -1
    for p in ([0.0, 0.0, 0.0], [1.0, -0.7, 0.4], [-0.2, 0.1, -3.0]):
        n = rows([0.36, -0.48, 0.8], count)
        s = lights.sample(rows(p, count), n, transmits, numbers(count))
        used = (s["kind"] == LAMP) & (s["radiance"][:, 0] > 0.01 * s["radiance"].max())
        h = lights.hit(rows(p, count), n, transmits, s["direction"], sun=sun)
        found = used & (h["lamp"] == 0)
        assert found.sum() >= 0.995 * used.sum()  # a sample on the very edge may round to a miss
        np.testing.assert_allclose(h["pdf"][found], s["pdf"][found], rtol=3e-3)
        np.testing.assert_allclose(h["radiance"][found], s["radiance"][found], rtol=2e-2)
        np.testing.assert_allclose(h["uv"][found], s["uv"][found], atol=2e-2)
        if sun < 0:
            np.testing.assert_allclose(h["t"][found], s["distance"][found], rtol=1e-3)


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS.keys())
def test_moments_of_samples_are_those_of_the_density(lamp: dict[str, Any]) -> None:
    """Directions weighted by the density over the sphere have the same low moments as the samples drawn."""
    lights = store(lamp | {"matrix": TURN})
    shines = np.array([0.48, -0.6, -0.64])  # TURN's -z
    p, n = np.array([0.3, -0.2, 1.5]) + 1.2 * shines + [0.1, 0.2, 0.05], -shines
    count = 1 << 13
    s = lights.sample(rows(p, count), rows(n, count), False, numbers(count))
    used = s["kind"] == LAMP
    mean = s["direction"][used].astype(float).mean(0)
    axis = mean / np.linalg.norm(mean)
    gap = min(2.0, 1.2 * float(1.0 - (s["direction"][used].astype(float) @ axis).min()))
    d = cone_directions(axis, gap, 1 << 15)
    h = lights.hit(rows(p, len(d)), rows(n, len(d)), False, d, sun=0 if lamp["shape"] == "SUN" else -1)
    lit = (h["lamp"] == 0) & (h["radiance"][:, 0] > 0)
    weight = np.where(lit, h["pdf"], 0.0) * 2 * math.pi * gap
    assert weight.mean() == pytest.approx(used.mean(), rel=0.01)
    np.testing.assert_allclose((weight[:, None] * d).mean(0), mean * used.mean(), atol=0.01)


@pytest.mark.parametrize(
    "where", [(0.0, 0.0, 1.0), (0.0, 0.0, 1.0 + 1e-6), (0.3, 0.0, 1.0), (1e20, 0.0, 0.0), (0.0, 0.0, 1.3)]
)
@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS.keys())
def test_points_on_in_and_far_from_a_lamp_get_finite_light(lamp: dict[str, Any], where: tuple[float, ...]) -> None:
    values = contributions(store(lamp | {"matrix": look_down()}), where, UP, 1 << 8)
    assert np.isfinite(values).all()


@pytest.mark.parametrize("power", [math.inf, math.nan, 0.0, -5.0, 1e30])
@pytest.mark.parametrize("shape", ["POINT", "SPOT", "SUN", "SQUARE", "DISK"])
def test_broken_or_extreme_power_stays_finite(power: float, shape: str) -> None:
    lights = store({"shape": shape, "matrix": look_down(), "power": power, "radius": 0.1})
    values = contributions(lights, ORIGIN, UP, 1 << 8)
    assert np.isfinite(values).all()
    if not math.isfinite(power):
        assert (values == 0.0).all()


def test_lamp_of_scale_zero_or_edge_on_or_behind_gives_nothing() -> None:
    flat = [0.0] * 12
    flat[11] = 1.0
    assert irradiance(store({"shape": "SQUARE", "matrix": flat}), ORIGIN, UP) == 0.0
    lamp = {"shape": "SQUARE", "matrix": look_down()}
    assert irradiance(store(lamp), (3.0, 0.0, 1.0), UP) == 0.0  # in the lamp's plane
    assert irradiance(store(lamp), (0.0, 0.0, 2.0), (0.0, 0.0, -1.0)) == 0.0  # behind it


def test_rays_see_a_lamp_only_where_its_visibility_says() -> None:
    lamp = {"shape": "SQUARE", "matrix": look_down(), "size": 1.0, "visibility": 62}
    up = rows(UP, 1)
    assert store(lamp).hit(rows(ORIGIN, 1), up, False, up, 2)["lamp"][0] == 0
    assert store(lamp).hit(rows(ORIGIN, 1), up, False, up, 1)["lamp"][0] == NOWHERE
    assert store(lamp | {"use_mis": False}).hit(rows(ORIGIN, 1), up, False, up, 2)["lamp"][0] == NOWHERE
    seen = store(lamp | {"use_mis": False, "visibility": 63}).hit(rows(ORIGIN, 1), up, False, up, 1)
    assert seen["lamp"][0] == 0 and seen["t"][0] == pytest.approx(1.0)


def test_closest_of_a_thousand_lamps_is_the_one_a_loop_over_single_lamps_finds() -> None:
    rng = np.random.default_rng(3)
    shapes = ["POINT", "SQUARE", "DISK", "SPOT"]
    lamps = []
    for i in range(1000):
        x, y, z = rng.uniform(-5, 5, 3)
        lamps.append({"shape": shapes[i % 4], "matrix": look_down(x, y, z), "radius": 0.2, "size": 0.4,
                      "soft_falloff": bool(i % 3), "spot_size": 1.5})  # fmt: skip
    count = 2000
    p = rng.uniform(-6, 6, (count, 3)).astype(np.float32)
    d = sphere_directions(2048)[:count]
    hit = store(*lamps).hit(p, d, False, d)
    best = np.full(count, np.inf, np.float32)
    which = np.full(count, NOWHERE, np.uint32)
    for i, lamp in enumerate(lamps):
        t = store(lamp).hit(p, d, False, d)
        nearer = (t["lamp"] == 0) & (t["t"] < best)
        best[nearer], which[nearer] = t["t"][nearer], i
    np.testing.assert_array_equal(hit["lamp"], which)
    assert (which != NOWHERE).sum() > 100

"""Accuracy of the elementary functions against numpy's double precision, and their special cases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray

F32 = NDArray[np.float32]
math = core.math
rng = np.random.default_rng(20)
N = 300_000
INF, NAN = np.float32(np.inf), np.float32(np.nan)


def ulps(got: F32, exact: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance in units of the last place of the exact value as a float (denormals: of the smallest)."""
    with np.errstate(over="ignore"):
        step = np.spacing(np.abs(exact).astype(np.float32)).astype(np.float64)
    return np.abs(got.astype(np.float64) - exact) / step


def uniform(low: float, high: float) -> F32:
    return rng.uniform(low, high, N).astype(np.float32)


def all_scales(low: float, high: float) -> F32:
    return np.exp2(rng.uniform(np.log2(low), np.log2(high), N)).astype(np.float32)


def signed(x: F32) -> F32:
    return np.where(rng.random(x.size) < 0.5, -x, x).astype(np.float32)


ONE: list[tuple[str, Callable[[], F32], float]] = [
    ("sin", lambda: uniform(-10, 10), 2.0),
    ("sin", lambda: signed(all_scales(1e-30, 1e5)), 2.0),
    ("cos", lambda: uniform(-10, 10), 2.0),
    ("cos", lambda: signed(all_scales(1e-30, 1e5)), 2.0),
    ("tan", lambda: uniform(-1e5, 1e5), 4.0),
    ("asin", lambda: uniform(-1, 1), 2.5),
    ("asin", lambda: signed(all_scales(1e-30, 1)), 2.5),
    ("acos", lambda: uniform(-1, 1), 2.0),
    ("acos", lambda: (1 - all_scales(1e-7, 1)).astype(np.float32), 2.0),
    ("atan", lambda: signed(all_scales(1e-37, 1e37)), 2.0),
    ("exp", lambda: uniform(-87, 88.5), 2.0),
    ("exp", lambda: signed(all_scales(1e-20, 80)), 2.0),
    ("exp", lambda: uniform(-103, -87), 1.0),
    ("exp2", lambda: uniform(-126, 128), 2.0),
    ("exp2", lambda: uniform(-149, -126), 1.0),
    ("log", lambda: all_scales(1e-44, 3e38), 2.0),
    ("log", lambda: uniform(0.5, 2), 2.0),
    ("log2", lambda: all_scales(1e-44, 3e38), 2.0),
    ("log2", lambda: uniform(0.5, 2), 2.0),
]
NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}


@pytest.mark.parametrize(("name", "make", "bound"), ONE)
def test_functions_of_one_number_are_right_to_the_last_places(name: str, make: Callable[[], F32], bound: float) -> None:
    x = make()
    error = ulps(getattr(math, name)(x), getattr(np, NUMPY.get(name, name))(x.astype(np.float64)))
    worst = int(np.argmax(error))
    print(f"{name} on {x.min():.3g} .. {x.max():.3g}: at most {error[worst]:.2f} ulp, at {x[worst]!r}")
    assert error[worst] <= bound


def test_trigonometry_stays_close_far_out_and_bounded_everywhere() -> None:
    x = signed(all_scales(1e5, 1e6))
    error = np.abs(math.sin(x) - np.sin(x.astype(np.float64))).max()
    print(f"sin up to 1e6: absolute error {error:.1e}")
    assert error < 2e-6
    x = signed(all_scales(1e6, 3e38))
    for name in ("sin", "cos"):
        y = getattr(math, name)(x)
        assert np.isfinite(y).all() and np.abs(y).max() <= 1.0


def test_atan2_in_every_direction_and_at_every_scale() -> None:
    angle = uniform(-np.pi, np.pi).astype(np.float64)
    radius = np.exp2(rng.uniform(-120, 126, N))
    y, x = (radius * np.sin(angle)).astype(np.float32), (radius * np.cos(angle)).astype(np.float32)
    error = ulps(math.atan2(y, x), np.arctan2(y.astype(np.float64), x.astype(np.float64)))
    print(f"atan2: at most {error.max():.2f} ulp")
    assert error.max() <= 2.5
    special = np.float32([0.0, -0.0, 1.0, -1.0, INF, -INF, 3e38, 1e-45, NAN])
    y, x = (v.ravel() for v in np.meshgrid(special, special))
    np.testing.assert_allclose(math.atan2(y, x), np.arctan2(y, x), rtol=2e-7)
    zero = (y == 0) & ~np.isnan(x)
    np.testing.assert_array_equal(np.signbit(math.atan2(y, x)[zero]), np.signbit(y[zero]))


POWERS: list[tuple[str, Callable[[], F32], Callable[[], F32]]] = [
    ("gamma curves", lambda: uniform(0, 1), lambda: uniform(0.1, 5)),
    ("large exponents", lambda: uniform(0.5, 2), lambda: uniform(-120, 120)),
    ("near one", lambda: uniform(0.999, 1.001), lambda: uniform(-60000, 60000)),
    ("every base", lambda: all_scales(1e-44, 3e38), lambda: uniform(-0.9, 0.9)),
    ("whole powers of negative numbers", lambda: uniform(-9, 0), lambda: np.round(uniform(-30, 30))),
]


@pytest.mark.parametrize(("name", "bases", "exponents"), POWERS)
def test_powers_are_right_to_the_last_places(name: str, bases: Callable[[], F32], exponents: Callable[[], F32]) -> None:
    x, y = bases(), exponents()
    exact = np.power(x.astype(np.float64), y.astype(np.float64))
    normal = (np.abs(exact) > 1.2e-38) & (np.abs(exact) < 3.4e38)
    error = ulps(math.pow(x, y), exact)[normal]
    print(f"pow, {name}: at most {error.max():.2f} ulp")
    assert normal.sum() > N / 3 and error.max() <= 2.5


def test_powers_have_the_special_cases_of_c() -> None:
    values = [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 2.5, 1e-40, 3e38, -3e38, INF, -INF, NAN]
    x, y = (np.float32(v).ravel() for v in np.meshgrid(values, values))
    with np.errstate(all="ignore"):
        exact = np.power(x, y)
    got = math.pow(x, y)
    for a, b, g, e in zip(x, y, got, exact, strict=True):
        same = (np.isnan(g) and np.isnan(e)) or (np.isclose(g, e, rtol=3e-7, atol=1e-44))
        assert same and (np.isnan(e) or np.signbit(g) == np.signbit(e)), f"pow({a}, {b}) = {g}, not {e}"


@pytest.mark.parametrize("name", ["exp", "exp2", "log", "log2", "sin", "cos", "tan", "atan"])
def test_special_values_are_those_of_c(name: str) -> None:
    x = np.float32([0.0, -0.0, INF, -INF, NAN, -1.0, 1e-45, 200.0, -200.0])
    with np.errstate(all="ignore"):
        exact = getattr(np, NUMPY.get(name, name))(x)
    np.testing.assert_allclose(getattr(math, name)(x), exact, rtol=2e-7)


@pytest.mark.parametrize("largest_quotient", [1.0, 1e3, 1e6, 1e10, 1e13])
def test_fmod_is_exact(largest_quotient: float) -> None:
    y = signed(all_scales(1e-12, 1e12))
    x = (y * rng.uniform(-largest_quotient, largest_quotient, N)).astype(np.float32)
    np.testing.assert_array_equal(math.fmod(x, y), np.fmod(x, y))


def test_fmod_has_the_special_cases_of_c() -> None:
    values = np.float32([0.0, -0.0, 1.0, -1.5, 3e38, 1e-45, INF, -INF, NAN])
    x, y = (v.ravel() for v in np.meshgrid(values, values))
    with np.errstate(all="ignore"):
        kept = ~(np.abs(x / y) > 2.0**44) | ~np.isfinite(x) | (y == 0)  # a larger quotient gives 0
    with np.errstate(all="ignore"):
        exact = np.fmod(x, y)
    np.testing.assert_array_equal(math.fmod(x, y)[kept], exact[kept])

"""Phase functions: normalised, as their papers have them, sampled as they are."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core, mie
from numpy.typing import NDArray
from scipy import integrate, stats

F64 = NDArray[np.float64]
SHAPES = [
    ("HENYEY_GREENSTEIN", 0.0, 0.0), ("HENYEY_GREENSTEIN", 0.7, 0.0), ("HENYEY_GREENSTEIN", -0.7, 0.0),
    ("HENYEY_GREENSTEIN", 0.999, 0.0), ("HENYEY_GREENSTEIN", -1.0, 0.0), ("DRAINE", 0.0, 1.0), ("DRAINE", 0.6, 2.0),
    ("DRAINE", -0.5, 20.0), ("DRAINE", 0.99, 250.0), ("FOURNIER_FORAND", 1.33, 0.1), ("FOURNIER_FORAND", 1.1, 0.02),
    ("FOURNIER_FORAND", 1.5, 0.45), ("FOURNIER_FORAND", 2.0, 0.5),
]  # fmt: skip


def towards(t: F64) -> NDArray[np.float32]:
    """Directions with sin^2(angle / 2) = t around +z."""
    sine = 2.0 * np.sqrt(t * (1.0 - t))
    return np.stack([sine, 0.0 * t, 1.0 - 2.0 * t], axis=1).astype(np.float32)


def density(shape: tuple[str, float, float], t: F64) -> F64:
    """Around the peak's own axis: -z where the function scatters back."""
    return np.asarray(core.media.phase_density(*shape, axis(shape) * towards(t)), np.float64)


def axis(shape: tuple[str, float, float]) -> float:
    return -1.0 if shape[0] != "FOURNIER_FORAND" and shape[1] < 0.0 else 1.0


def fine(count: int = 200_001) -> F64:
    """Points over t, close to each other at both ends, where peaks are."""
    peaks = np.geomspace(1e-13, 1e-2, count // 3)
    return np.unique(np.concatenate([[0.0], peaks, np.linspace(0.0, 1.0, count), 1.0 - peaks, [1.0]]))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_phase_function_is_normalised(shape: tuple[str, float, float]) -> None:
    t = fine()
    values = density(shape, t)
    assert (values >= 0.0).all()
    # Single precision ends at an angle of 2e-7: what an endless peak has within is not seen by quadrature.
    lost = 0.02 if shape[0] == "FOURNIER_FORAND" else 2e-3
    assert integrate.trapezoid(values, t) * 4.0 * np.pi == pytest.approx(1.0, abs=lost)


def henyey_greenstein(g: float, cosine: F64) -> F64:
    return (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)


@pytest.mark.parametrize("g", [-0.7, 0.0, 0.3, 0.9])
@pytest.mark.parametrize("alpha", [0.0, 1.0, 30.0])
def test_values_are_those_of_the_papers(g: float, alpha: float) -> None:
    t = np.linspace(1e-3, 1.0, 500)
    cosine = 1.0 - 2.0 * t
    expected = henyey_greenstein(abs(g), cosine)
    np.testing.assert_allclose(density(("HENYEY_GREENSTEIN", g, 0.0), t), expected, rtol=2e-5)
    expected = expected * (1.0 + alpha * cosine**2) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)
    np.testing.assert_allclose(density(("DRAINE", g, alpha), t), expected, rtol=2e-3)


def test_a_function_that_is_all_but_a_straight_line_stays_finite() -> None:
    assert np.isfinite(density(("FOURNIER_FORAND", 1.0, 0.0), fine())).all()
    u = np.random.default_rng(1).random((1000, 2), np.float32)
    assert np.isfinite(core.media.sample_phase("FOURNIER_FORAND", 1.0, 0.0, u)).all()


@pytest.mark.parametrize(("n", "back"), [(1.33, 0.1), (1.1, 0.02), (1.5, 0.4)])
def test_fournier_and_forand_scatter_back_as_much_as_asked(n: float, back: float) -> None:
    t = np.linspace(0.5, 1.0, 2001)
    assert integrate.trapezoid(density(("FOURNIER_FORAND", n, back), t), t) * 4.0 * np.pi == pytest.approx(
        back, rel=0.01
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_samples_follow_the_density(shape: tuple[str, float, float]) -> None:
    """Chi-square over angles; the turn around the axis is even."""
    rng = np.random.default_rng(5)
    count, bins = 40_000, 32
    u = rng.random((count, 2), np.float32)
    w = axis(shape) * np.asarray(core.media.sample_phase(*shape, u), np.float64)
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0, atol=1e-6)
    flat = fine()
    cumulative = integrate.cumulative_trapezoid(density(shape, flat), flat, initial=0.0)
    edges = np.interp(np.linspace(0.0, 1.0, bins + 1) * cumulative[-1], cumulative, flat)
    edges[0], edges[-1] = 0.0, 1.0
    # sin^2 of half the angle, without the cancellation of 1 - cosine.
    t = np.where(w[:, 2] > 0.0, (w[:, 0] ** 2 + w[:, 1] ** 2) / (2.0 * (1.0 + np.abs(w[:, 2]))), 0.5 * (1.0 - w[:, 2]))
    width = np.interp(edges, flat, cumulative)
    found, _ = np.histogram(t, edges)
    expected = np.diff(width) / width[-1] * count
    wide = expected > 20.0
    # What falls into the endless peak is not in the quadrature: one bin is left out there.
    wide[0] &= shape[0] != "FOURNIER_FORAND"
    scale = found[wide].sum() / expected[wide].sum()
    assert scale == pytest.approx(1.0, abs=0.03)
    chi = ((found[wide] - scale * expected[wide]) ** 2 / (scale * expected[wide])).sum()
    assert stats.chi2.sf(chi, wide.sum() - 1) > 1e-4
    turns = np.histogram(np.arctan2(w[:, 1], w[:, 0]), 16)[0]
    assert stats.chisquare(turns).pvalue > 1e-4


@pytest.mark.parametrize("diameter", [0.0, 0.05, 0.1, 0.5, 1.49, 1.5, 3.0, 4.99, 5.0, 20.0, 50.0, 1e9])
def test_the_fit_for_drops_is_a_blend_of_valid_functions(diameter: float) -> None:
    fit = mie.fit(diameter)
    assert 0.0 <= fit.draine_share <= 1.0
    assert 0.0 <= fit.g_henyey_greenstein < 1.0
    assert -0.01 <= fit.g_draine < 1.0
    assert fit.alpha >= 0.0


@pytest.mark.parametrize("edge", [1.5, 5.0])
def test_the_pieces_of_the_fit_meet(edge: float) -> None:
    """Forward-scattered light, a whole phase function in one number, jumps little where formulas change."""
    means = []
    for diameter in (edge * (1.0 - 1e-9), edge * (1.0 + 1e-9)):
        fit = mie.fit(diameter)
        t = fine(20_001)
        blend = (1.0 - fit.draine_share) * density(("HENYEY_GREENSTEIN", fit.g_henyey_greenstein, 0.0), t)
        blend += fit.draine_share * density(("DRAINE", fit.g_draine, fit.alpha), t)
        means.append(integrate.trapezoid(blend * (1.0 - 2.0 * t), t) * 4.0 * np.pi)
    assert means[0] == pytest.approx(means[1], abs=0.03)

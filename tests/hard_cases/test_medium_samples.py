"""Numbers that walks under surfaces and flights through media draw follow the densities that weigh them: chi-square.

Numbers: the rows of the list of hard cases.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from scipy import integrate, stats
from support.phases import SHAPES, axis, density, fine

F64 = NDArray[np.float64]
COUNT, BINS = 1 << 16, 64
# Kind, its numbers (native/bindings/media.cpp), and the interval that it is drawn from.
LINES = {
    **{f"walk, g {g}": (("WALK", g, 0.0, 0.0), (-1.0, 1.0)) for g in (0.0, 5e-4, 2e-3, 0.6, -0.5, 0.99)},
    **{f"guided, albedo {a}": (("GUIDED", a, 0.0, 0.0), (-1.0, 1.0)) for a in (0.2, 0.8, 0.9999, 1.0 - 1e-6)},
    **{f"profile of {length}": (("PROFILE", length, 0.0, 0.0), (0.0, 16.0 * length)) for length in (1.0, 1e-5, 300.0)},
    **{f"flight, depth {depth:g}": (("FLIGHT", depth / 7.0, 7.0, 0.0), (0.0, 7.0)) for depth in (1e-6, 9e-4, 2e-3, 1.0, 30.0)},
    **{f"equiangular, {c} beside": (("EQUIANGULAR", 2.0, 5.0, c), (0.0, 5.0)) for c in (0.0, 1e-3, 0.3, 40.0)},
    "equiangular, behind": (("EQUIANGULAR", -3.0, 5.0, 0.5), (0.0, 5.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", LINES)
def test_41_samples_of_a_line_follow_their_density(name: str) -> None:
    kind, (low, high) = LINES[name]
    x = core.media.sample_line(*kind, np.random.default_rng(46).random(COUNT, dtype=np.float32)).astype(float)
    slack = 1e-5 * (high - low)
    assert x.min() >= low - slack and x.max() <= high + slack
    # Bins of about one share each, by the samples of other numbers: peaks are narrow.
    even = (np.arange(1, BINS) / BINS).astype(np.float32)
    edges = np.concatenate([[low], np.sort(core.media.sample_line(*kind, even).astype(float)), [high]])
    edges = np.unique(np.clip(edges, low, high))

    def density(at: F64) -> F64:
        return core.media.line_density(*kind, at.astype(np.float32)).astype(float)

    expected = COUNT * np.array([integrate.fixed_quad(density, a, b, n=80)[0]
                                 for a, b in itertools.pairwise(edges)])  # fmt: skip
    observed = np.histogram(x, edges)[0]
    assert expected.sum() == pytest.approx(COUNT, rel=2e-3)
    excess = np.maximum(np.abs(observed - expected) - 0.004 * expected - 2.0, 0.0)  # quadrature, and edges in floats
    p = stats.chi2.sf((excess**2 / np.maximum(expected, 1.0)).sum(), len(expected) - 1)
    assert p > 0.01 / len(LINES), (observed, expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_41_samples_of_a_phase_function_follow_their_density(shape: tuple[str, float, float]) -> None:
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

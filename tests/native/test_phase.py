"""Phase functions: normalised, as their papers have them, sampled as they are."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core, mie
from scipy import integrate
from support.phases import F64, SHAPES, density, fine


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

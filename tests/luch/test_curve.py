"""What the curve of errors foretells, and what it takes out of its points."""

from __future__ import annotations

import numpy as np
import pytest
from luch.accuracy import Estimate, overstated, percent
from luch.curve import Curve, describe, next_target
from support import synthetic


def estimate(error: float, spread: float = 1.02) -> Estimate:
    return Estimate(error, error / spread, error * spread, 0.0, 1.0, 1.0, 1.0)


def test_the_curve_foretells_the_time_to_less_error() -> None:
    curve = Curve()
    assert curve.last is None and curve.forecast(0.01).seconds == np.inf
    for n in (8, 16, 32, 64, 128):
        error = 0.5 * n**-0.55
        curve.add(n, 0.1 * n, estimate(error * overstated(0.5, 1.1) ** 0.5))
    assert curve.last is not None
    assert curve.rate()[0] == pytest.approx(1.1, abs=0.02)
    assert curve.last.error == pytest.approx(error, rel=0.03)
    ahead = curve.forecast(error / 2)
    assert ahead.seconds == pytest.approx(12.8 * (2 ** (1 / 0.55) - 1), rel=0.12)
    assert ahead.seconds_low < ahead.seconds < ahead.seconds_high < 2 * ahead.seconds
    assert curve.forecast(2 * error).seconds == 0.0
    assert [next_target(e) for e in (0.018, 0.0125, 0.9, 0.6)] == pytest.approx([0.01, 0.01, 0.5, 0.2])


def test_a_jump_of_the_error_makes_the_forecast_less_sure() -> None:
    smooth, jumping = Curve(), Curve()
    for k, n in enumerate((16, 24, 32, 48, 64, 96, 128)):
        smooth.add(n, 0.1 * n, estimate(n**-0.5))
        jumping.add(n, 0.1 * n, estimate(n**-0.5 * (1.6 if k in (2, 5) else 1.0)))
    assert jumping.rate()[1] > 1.5 * smooth.rate()[1]


def test_a_rate_unlike_all_that_were_measured_is_less_sure() -> None:
    """It is believed slowly; that it is doubted can be seen."""
    curves = {power: Curve() for power in (1.07, 1.5)}
    for power, curve in curves.items():
        for n in (8, 16, 32, 64, 128):
            curve.add(n, 0.1 * n, estimate(n ** (-power / 2)))
    usual, unlike = (curves[power].rate() for power in (1.07, 1.5))
    assert usual[0] == pytest.approx(1.07, abs=0.02) and 1.1 < unlike[0] < 1.5
    assert unlike[1] > 3.0 * usual[1]


@pytest.mark.parametrize(
    ("noise", "sampler", "off"),
    [
        (synthetic.normal, "INDEPENDENT", 0.1),
        (synthetic.fireflies, "INDEPENDENT", 0.2),
    ],
)
def test_time_is_foretold_within_its_interval(noise: synthetic.Noise, sampler: str, off: float) -> None:
    """From 64 samples, the time to the error of 256."""
    rng = np.random.default_rng(5)
    covered, ratios = [], []
    for _ in range(12):
        picture = synthetic.Picture(noise, rng)
        curve = picture.looked_at([8, 12, 16, 24, 32, 48, 64], sampler)
        ahead = curve.forecast(picture.error(256))
        covered.append(ahead.seconds_low <= 0.01 * 192 <= ahead.seconds_high)
        ratios.append(np.log((ahead.seconds + 0.64) / 2.56))
    assert abs(np.median(ratios)) <= off
    assert np.mean(covered) >= 0.6  # of 12


def test_errors_that_fall_as_no_renders_are_not_foretold_too_hopefully() -> None:
    rng = np.random.default_rng(5)
    for _ in range(6):
        picture = synthetic.Picture(synthetic.stratified, rng)
        ahead = picture.looked_at([8, 12, 16, 24, 32, 48, 64]).forecast(picture.error(256))
        assert 1.0 < (ahead.seconds + 0.64) / 2.56 < 1.7


def test_people_read_two_digits() -> None:
    stats = {"error": 0.01834, "error_low": 0.0171, "error_high": 0.1234}
    assert describe(stats) == "error 1.8 % (1.7 to 12 %)"
    assert (percent(0.0), percent(1.52), percent(0.000456)) == ("0", "152", "0.046")
    ahead = {"next_error": 0.01, "seconds_to_next_error": 41.2}
    ahead |= {"seconds_to_next_error_low": 34.0, "seconds_to_next_error_high": 52.0}
    assert describe({**stats, **ahead}).endswith("; 1 % would take 41 s (34 to 52 s) more")

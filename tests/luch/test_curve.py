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
        error = 0.5 * n**-0.6
        curve.add(n, 0.1 * n, estimate(error * overstated(0.5, 1.2) ** 0.5))
    assert curve.last is not None
    assert curve.rate()[0] == pytest.approx(1.2, abs=0.04)
    assert curve.last.error == pytest.approx(error, rel=0.03)
    ahead = curve.forecast(error / 2)
    assert ahead.seconds == pytest.approx(12.8 * (2 ** (1 / 0.6) - 1), rel=0.12)
    assert ahead.seconds_low < ahead.seconds < ahead.seconds_high < 2 * ahead.seconds
    assert curve.forecast(2 * error).seconds == 0.0
    assert [next_target(e) for e in (0.018, 0.0125, 0.9, 0.6)] == pytest.approx([0.01, 0.01, 0.5, 0.2])


def test_a_jump_of_the_error_makes_the_forecast_less_sure() -> None:
    smooth, jumping = Curve(), Curve()
    for k, n in enumerate((16, 24, 32, 48, 64, 96, 128)):
        smooth.add(n, 0.1 * n, estimate(n**-0.5))
        jumping.add(n, 0.1 * n, estimate(n**-0.5 * (1.6 if k in (2, 5) else 1.0)))
    assert jumping.rate()[1] > 1.5 * smooth.rate()[1]


@pytest.mark.parametrize(
    ("noise", "off"), [(synthetic.normal, 0.1), (synthetic.stratified, 0.2), (synthetic.fireflies, 0.2)]
)
def test_time_is_foretold_within_its_interval(noise: synthetic.Noise, off: float) -> None:
    """From 64 samples, the time to the error of 256. A rate far from all that was measured is believed slowly."""
    rng = np.random.default_rng(5)
    covered, ratios = [], []
    for _ in range(12):
        picture = synthetic.Picture(noise, rng)
        curve = picture.looked_at([8, 12, 16, 24, 32, 48, 64])
        ahead = curve.forecast(picture.error(256))
        covered.append(ahead.seconds_low <= 0.01 * 192 <= ahead.seconds_high)
        ratios.append(np.log((ahead.seconds + 0.64) / 2.56))
    assert abs(np.median(ratios)) <= off
    assert np.mean(covered) >= 0.6  # of 12


def test_people_read_two_digits() -> None:
    stats = {"error": 0.01834, "error_low": 0.0171, "error_high": 0.1234}
    assert describe(stats) == "error 1.8 % (1.7 to 12 %)"
    assert (percent(0.0), percent(1.52), percent(0.000456)) == ("0", "152", "0.046")
    ahead = {"next_error": 0.01, "seconds_to_next_error": 41.2}
    ahead |= {"seconds_to_next_error_low": 34.0, "seconds_to_next_error_high": 52.0}
    assert describe({**stats, **ahead}).endswith("; 1 % would take 41 s (34 to 52 s) more")

"""Scattering by water drops: a blend of two phase functions in place of Mie's sums.

J. Jendersie and E. d'Eon, "An Approximate Mie Scattering Function for Fog and Cloud Rendering", SIGGRAPH 2023 Talks:
the blend's four parameters as functions of the drops' diameter, fitted there for 0 to 50 micrometres.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, log, sin, tan

LARGEST_UM = 50.0


@dataclass(frozen=True)
class Fit:
    """(1 - draine_share) Henyey-Greenstein + draine_share Draine."""

    g_henyey_greenstein: float
    g_draine: float
    alpha: float
    draine_share: float


def fit(diameter_um: float) -> Fit:
    """Parameters for drops of a diameter in micrometres, taken within 0 to 50."""
    d = min(max(diameter_um, 0.0), LARGEST_UM)
    if d <= 0.1:
        return Fit(13.8 * d * d, 1.1456 * d * sin(9.29044 * d), 250.0, 0.252977 - 312.983 * d**4.3)
    x = log(d)
    if d < 1.5:
        phase = 1.19692 * cos((x - 0.238604) * (x + 1.00667) / (0.507522 - 0.15677 * x)) + 1.37932 * x + 0.0625835
        return Fit(
            0.862 - 0.143 * x * x,
            0.379685 * cos(phase) + 0.344213,
            250.0,
            0.146209 * cos(3.38707 * x + 2.11193) + 0.316072 + 0.0778917 * x,
        )
    if d < 5.0:
        return Fit(
            0.0604931 * log(x) + 0.940256,
            0.500411 - 0.081287 / (-2.0 * x + tan(x) + 1.27551),
            7.30354 * x + 6.31675,
            0.026914 * (x - cos(5.68947 * (log(x) - 0.0292149))) + 0.376475,
        )
    return Fit(
        exp(-0.0990567 / (d - 1.67154)),
        exp(-2.20679 / (d + 3.91029) - 0.428934),
        exp(3.62489 - 8.29288 / (d + 5.52825)),
        exp(-0.599085 / (d - 0.641583) - 0.665888),
    )

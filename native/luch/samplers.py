"""The families of points that paths draw their random numbers from (native/include/luch/sampling/sampler.h).

They differ in noise alone; the picture that endless samples give is the same.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Family:
    """relMSE ~ samples^-rate: what is known of the rate before a render has shown its own (luch.curve)."""

    title: str
    reason: str
    rate: float
    spread: float  # one standard deviation; 0: it is so by construction


# Rates: measured from 32 samples on; 1.0 to 1.15 with Sobol's points over six scenes, 0.99 to 1.23 with lattices over four.
FAMILIES = {
    "SOBOL": Family("Sobol", "Owen-scrambled Sobol points", 1.07, 0.12),
    "INDEPENDENT": Family("independent", "random numbers that know nothing of each other", 1.0, 0.0),
    "LATTICE": Family("lattice", "rank-1 lattices, shifted at random", 1.1, 0.12),
}
NAMES = tuple(FAMILIES)  # in the order of SamplerFamily
DEFAULT = "SOBOL"

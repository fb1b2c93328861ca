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


# Rates: measured in twelve scenes with eight seeds. From 64 to 256 samples 1.00 to 1.14 (1.22 where much is blurred by
# motion), from 256 to 1,024 samples 0.97 to 1.05 (1.13); Sobol's points and lattices do not differ.
FAMILIES = {
    "SOBOL": Family("Sobol", "Owen-scrambled Sobol points", 1.07, 0.06),
    "INDEPENDENT": Family("independent", "random numbers that know nothing of each other", 1.0, 0.0),
    "LATTICE": Family("lattice", "rank-1 lattices, shifted at random", 1.07, 0.06),
}
NAMES = tuple(FAMILIES)  # in the order of SamplerFamily
DEFAULT = "SOBOL"

"""How light is followed: the integrators, a closed list (native/include/luch/integrator).

They differ in what they find well; what they share are the stages of a path.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Integrator:
    """What a user chooses, and what it is good for."""

    title: str
    reason: str


INTEGRATORS = {
    "PATH": Integrator("Path Tracing", "paths from the camera find all light"),
    "PHOTON": Integrator(
        "Path Tracing and Photon Maps",
        "light that comes to a surface over mirrors or through glass is brought by photons, a little blurred at first",
    ),
}
NAMES = tuple(INTEGRATORS)
DEFAULT = "PATH"

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
    photons: bool = False  # photon maps bring caustics
    ends_at: frozenset[str] = frozenset()  # kinds of bounces after which no light is followed, whatever their limits

    def why_none(self, kind: str) -> str:
        """In words, why no bounce of a kind is followed."""
        return f"{self.title} follows none" if kind in self.ends_at else "set to 0"


INTEGRATORS = {
    "PATH": Integrator("Path Tracing", "paths from the camera find all light"),
    "PHOTON": Integrator(
        "Path Tracing and Photon Maps",
        "light that comes to a surface over mirrors or through glass is brought by photons, a little blurred at first",
        photons=True,
    ),
    # Cook, Porter and Carpenter 1984: all that is spread over an area, an angle or a time is sampled, light between
    # matt surfaces is not. A ray that scatters from one still sees lights, as their sampling is weighed against it.
    "DISTRIBUTION": Integrator(
        "Distribution Ray Tracing",
        "direct light, glossy reflection and refraction, lens and motion blur; no light from one matt surface to another",
        ends_at=frozenset({"diffuse", "volume"}),
    ),
}
NAMES = tuple(INTEGRATORS)
DEFAULT = "PATH"


def named(name: str) -> Integrator:
    """ValueError: there is none of that name."""
    if name not in INTEGRATORS:
        known = f"{', '.join(NAMES[:-1])} or {NAMES[-1]}"
        raise ValueError(f"Settings: the integrator is {name!r}; it can be {known}.")
    return INTEGRATORS[name]

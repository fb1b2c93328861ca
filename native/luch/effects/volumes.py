"""Effects of volumes: which materials and which world hold a medium, and what it does to light."""

from __future__ import annotations

from luch import integrators
from luch.effects.shown import Shown
from luch.effects.table import Effects
from luch.scene import Medium

NONE = "no object, material or world has a volume"


def add_volumes(effects: Effects, shown: Shown) -> None:
    """Whether there are any, and which."""
    found = media_shown(shown)
    if not found:
        idle = [surface.title for surface in shown.idle if surface.volume and holds(surface.volume)]
        note = f" ({idle[0]} has, but is on no face that is drawn)" if idle else ""
        effects.add("Geometry", "volumes", False, NONE + note)
        return
    title, medium = found[0]
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    cost = "every ray asks which volumes it is in, shadow rays too: 64 bytes each"
    effects.add("Geometry", "volumes", True, f"{title} {told(medium)}{more}", cost=cost)


def add_volume_bounces(effects: Effects, shown: Shown) -> int:
    """Returns how often a path may scatter in volumes."""
    settings = shown.scene.settings
    limit = settings.bounces("volume")
    scattering = [title for title, medium in media_shown(shown) if scatters(medium)]
    if not scattering:
        off = f"no volume that is shown scatters light: the limit of {limit} cannot matter"
        effects.add("Paths", "volume bounces", False, off)
        return 0
    reason = f"up to {limit} after the first: {scattering[0]} scatters light"
    why = integrators.named(settings.integrator).why_none("volume")
    none = f"{why}: light that {scattering[0]} scatters once, and no more"
    effects.add("Paths", "volume bounces", limit > 0, reason if limit else none)
    return limit


def media_shown(shown: Shown) -> list[tuple[str, Medium]]:
    """The owner of each medium that a ray can come into."""
    found = [(surface.title, surface.volume) for surface in shown.surfaces]
    world = shown.scene.world
    if world is not None:
        found.append((f'world "{world.name}"', world.volume))
    return [(title, medium) for title, medium in found if medium is not None and holds(medium)]


def holds(medium: Medium) -> bool:
    """Whether there is anything in it."""
    return scatters(medium) or any((*medium.absorption, *medium.emission))


def scatters(medium: Medium) -> bool:
    """Whether light may turn in it."""
    return any(part > 0.0 for phase in medium.scattering for part in phase.scattering)


def told(medium: Medium) -> str:
    """ "absorbs 0.2 0.1 0, scatters 1 1 1 per metre"."""
    scattering = [sum(phase.scattering[channel] for phase in medium.scattering) for channel in range(3)]
    parts = [
        f"{verb} {' '.join(f'{part:.3g}' for part in numbers)}"
        for verb, numbers in (("absorbs", medium.absorption), ("scatters", scattering), ("emits", medium.emission))
        if any(numbers)
    ]
    return f"{', '.join(parts)} per metre"

"""Effects that are simulated though the scene does not call for them: Settings.force_effects.

No bit of the picture changes; what such an effect costs while it lies idle is the difference in time and bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from luch._native import core
from luch.effects.table import Effects

ALL = "ALL"  # every effect that can be
# What the core does on request, on either device; code for the others is a matter of what CUDA compiles.
IN_CORE: tuple[str, ...] = tuple(core.render.forcible_effects())


def forcible() -> tuple[str, ...]:
    """Names of effects that can be forced: the core's, and those whose code CUDA leaves out where a scene lacks them."""
    from luch.cuda.plan import NEEDED_BY  # which reads effects: not while this is imported

    return tuple(dict.fromkeys((*IN_CORE, *(name for names in NEEDED_BY.values() for name in names))))


def check(names: Iterable[str]) -> None:
    """Raises ValueError for a name that cannot be forced."""
    for name in names:
        if name not in (ALL, *forcible()):
            raise ValueError(
                f'The effect "{name}" cannot be simulated where a scene lacks it. These can, or {ALL}: '
                f"{', '.join(forcible())}."
            )


def force(effects: Effects, names: Iterable[str]) -> None:
    """Turns effects on, with the reason that they would have been off for."""
    asked = set(names)
    for name in forcible():
        if name in effects and not effects[name].on and not effects[name].missing and asked & {name, ALL}:
            idle = effects[name]
            reason = f"simulated on request, though {idle.reason}"
            effects.table[name] = replace(idle, on=True, reason=reason)

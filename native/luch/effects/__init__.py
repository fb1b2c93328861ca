"""Which effects a scene needs, each with its reason in words: from the scene, and from nowhere else.

>>> print(effects_of(scene))                                              # doctest: +SKIP
Effects: 21 on, 49 off
<BLANKLINE>
Surfaces
  on         transparency              material "Leaves" has alpha 0.5
...
>>> effects_of(scene)["depth of field"].reason                            # doctest: +SKIP
"the f-stop is set (f/2.8) but the camera's Depth of Field is disabled"
"""

from __future__ import annotations

from dataclasses import replace

from luch.effects.forcing import check, force
from luch.effects.lights import add_lights
from luch.effects.motion import add_motion
from luch.effects.picture import add_camera, add_film, add_geometry, add_later, add_paths
from luch.effects.removal import without
from luch.effects.shown import look_at
from luch.effects.surfaces import add_surfaces, add_textures
from luch.effects.table import Effect, Effects, summary
from luch.effects.volumes import add_volumes
from luch.scene import Scene

__all__ = ["Effect", "Effects", "effects_of", "summary"]


def effects_of(scene: Scene) -> Effects:
    """The effects of a scene: what is on, what is off, what it asks for in vain.

    Programs are followed from their closures, so that what changes nothing is not on. What the settings leave out or
    force is told so. Raises ValueError if a program is damaged, or for a name that cannot be left out or forced.
    """
    forced, left_out = scene.settings.force_effects, scene.settings.without_effects
    check(forced)
    effects = _found(without(scene, left_out))
    if left_out:
        wanted = _found(scene)
        for name in left_out:
            _tell_left_out(effects, name, wanted)
    force(effects, forced)
    return effects


def _tell_left_out(effects: Effects, name: str, wanted: Effects) -> None:
    if name in wanted and wanted[name].on:
        effects.table[name] = replace(wanted[name], on=False, left_out=True, cost="")


def _found(scene: Scene) -> Effects:
    effects, shown = Effects(), look_at(scene)
    add_surfaces(effects, shown)
    add_textures(effects, shown)
    add_lights(effects, shown)
    add_camera(effects, shown)
    add_motion(effects, shown)
    add_geometry(effects, shown)
    add_volumes(effects, shown)
    add_paths(effects, shown)
    add_film(effects, shown)
    add_later(effects, shown)
    return effects

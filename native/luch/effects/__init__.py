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

from luch.effects.lights import add_lights
from luch.effects.picture import add_camera, add_film, add_geometry, add_later, add_paths
from luch.effects.shown import look_at
from luch.effects.surfaces import add_surfaces, add_textures
from luch.effects.table import Effect, Effects, summary
from luch.scene import Scene

__all__ = ["Effect", "Effects", "effects_of", "summary"]


def effects_of(scene: Scene) -> Effects:
    """The effects of a scene: what is on, what is off, what it asks for in vain.

    Programs are followed from their closures, so that what changes nothing is not on. Raises ValueError if a
    program is damaged.
    """
    effects, shown = Effects(), look_at(scene)
    add_surfaces(effects, shown)
    add_textures(effects, shown)
    add_lights(effects, shown)
    add_camera(effects, shown)
    add_geometry(effects, shown)
    add_paths(effects, shown)
    add_film(effects, shown)
    add_later(effects, shown)
    return effects

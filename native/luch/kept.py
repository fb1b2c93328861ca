"""A prepared renderer that is kept from picture to picture: another view of the same scene builds nothing.

>>> kept = Kept()                                                         # doctest: +SKIP
>>> render(scene, kept=kept)                                              # doctest: +SKIP
>>> render(replace(scene, camera=moved), kept=kept).stats["structure_seconds"]   # doctest: +SKIP
0.0

What may change for nothing: camera, film, bounces, clamps, samples and the other limits. Where materials, images, lights
and the world change, a renderer on the CPU reads the scene anew and builds lights, but takes the structures over; a
change of geometry, or of where something is, builds all. The origin stays where the
first camera was as long as that shows nowhere (docs/numerics.md), so that a picture is the one of a fresh renderer with
that origin, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from luch.effects import effects_of
from luch.memory import available_bytes, scene_bytes
from luch.same import same
from luch.scene import Scene

# Fields of a scene that renderers take anew for each view, or never read.
_VIEW = {"camera", "film", "settings", "origin", "name", "frame", "warnings", "unsupported"}
# Of its settings, those that are such; another one may decide what is built, or on what.
_FREE = {
    "adaptive", "ao_distance", "caustics_reflective", "caustics_refractive", "clamp_direct", "clamp_indirect",
    "denoise", "diffuse_bounces", "error_limit", "estimate_error", "filter_glossy", "first_sample", "glossy_bounces",
    "max_bounces", "mergeable", "min_light_bounces", "min_transparent_bounces", "quality", "quality_report", "samples",
    "samples_in_all", "seed", "time_limit", "transmission_bounces", "transparent_bounces", "verify", "volume_bounces",
}  # fmt: skip

# Times as far from the origin as a finished picture bears: what is seen moves by a quarter of a pixel at most. For the
# first picture of a view that turns, which may have gone on before a GPU has built anew.
HURRIED = 16.0
# What structures do not hold.
_SHADING = {"materials", "images", "lights", "world"}
_NOWHERE = np.zeros((3, 4))
Maker = Callable[[Scene], tuple[Any, list[str]]]


@dataclass
class Prepared:
    """A renderer for a scene. reused: it is prepared already."""

    renderer: Any
    scene: Scene  # as it is rendered: its origin may be an earlier one
    warnings: list[str]
    reused: bool
    effects: dict[str, Any]  # luch.effects, as statistics have them


class Kept:
    """Nobody's but one thread's at a time. builds: renderers that were made so far."""

    def __init__(self) -> None:
        self.builds = 0
        self._scene: Scene | None = None  # as the caller had it
        self._held: Prepared | None = None
        self._reach = 0.0  # of the held origin, for the last view
        self.hurried = False  # what is asked for next may do with an origin that is farther away

    def is_far(self, scene: Scene) -> bool:
        """Whether this view is likely to ask for an origin, and a renderer, of its own."""
        return self._held is not None and math.dist(scene.origin, self._held.scene.origin) > self._reach

    @property
    def origin(self) -> tuple[float, float, float] | None:
        """Scene.origin of the renderer that is kept."""
        return self._held.scene.origin if self._held else None

    def serves(self, scene: Scene) -> bool:
        """Whether what is held, if anything, can draw this scene as it is: nothing would be built anew."""
        return self._scene is None or _alike(scene, self._scene, _VIEW, _FREE)

    def renderer_for(self, scene: Scene, traced: Scene, make: Maker) -> Prepared:
        """scene: as the caller has it; traced: what is to be rendered of it; make: for a new renderer."""
        held = self._held
        if held is not None and self._scene is not None:
            if self.serves(scene):
                seen = self._see(held, scene, traced)
                if seen is not None:
                    return seen
            elif _alike(scene, self._scene, _VIEW | _SHADING, _FREE | {"light_tree"}) and _shares(held, traced):
                return _reshaded(held, scene, traced, make)
            else:
                self.drop()  # before its successor takes memory
        held = None  # it would hold what was dropped
        self.builds += 1
        effects = effects_of(scene).as_dict()
        renderer, warnings = make(traced)
        return Prepared(renderer, traced, warnings, False, effects)

    def _see(self, held: Prepared, scene: Scene, traced: Scene) -> Prepared | None:
        """Through what is held; None: that does not serve.

        It stays, where there is memory, until its successor is prepared: views may turn faster, and coarse pictures
        need no new origin.
        """
        before, here = self._scene, replace(traced, origin=held.scene.origin)
        if not held.renderer.set_view(here):
            self.drop()
            return None
        distance = math.dist(traced.origin, held.scene.origin)
        if distance > 0.0:
            self._reach = float(held.renderer.origin_reach())
        if distance > self._reach * (HURRIED if self.hurried else 1.0):
            if not room_for_both(traced):
                self.drop()
            return None
        held.scene, self._scene = here, scene
        if before is None or not same(kind_of_view(scene), kind_of_view(before)):
            held.effects = effects_of(scene).as_dict()
        return replace(held, reused=True)

    def keep(self, scene: Scene, prepared: Prepared) -> None:
        """To be called once the renderer is prepared; nobody may change the scene any more."""
        if not prepared.reused:
            self._reach = 0.0  # until a view tells
        self._scene, self._held = scene, prepared

    def rest(self) -> None:
        """Gives back what only a render under way needs."""
        if self._held is not None and hasattr(self._held.renderer, "rest"):
            self._held.renderer.rest()

    def drop(self) -> None:
        """Keep nothing."""
        self._scene = self._held = None


def kind_of_view(scene: Scene) -> list[Any]:
    """All of a view but where it stands, how large it is and how many samples it has: what effects are on."""
    film = replace(scene.film, width=1, height=1, border=None, pixel_aspect=(1.0, 1.0))
    settings = replace(scene.settings, samples=1, seed=0, first_sample=0, samples_in_all=0, time_limit=0.0)
    return [replace(scene.camera, matrix=_NOWHERE), film, settings, scene.unsupported]


def _alike(a: Scene, b: Scene, but: set[str], settings_but: set[str]) -> bool:
    """Whether two scenes are the same in all other fields."""
    films = ((), ()) if but >= _SHADING else ((a.film.lightgroups, a.film.aovs), (b.film.lightgroups, b.film.aovs))
    return films[0] == films[1] and all(
        same(getattr(x, item.name), getattr(y, item.name))
        for x, y, left_out in ((a, b, but), (a.settings, b.settings, settings_but))
        for item in fields(x)
        if item.name not in left_out
    )


def _shares(held: Prepared, traced: Scene) -> bool:
    """Whether another renderer may take its structures over: on the CPU, while the camera stands still."""
    stands = same(held.scene.camera, traced.camera)
    return stands and hasattr(held.renderer, "take_structures") and room_for_both(traced)


def _reshaded(held: Prepared, scene: Scene, traced: Scene, make: Maker) -> Prepared:
    """A renderer that is still to be prepared, with the structures of the one that is held."""
    here = replace(traced, origin=held.scene.origin)
    renderer, warnings = make(here)
    renderer.take_structures(held.renderer)
    return Prepared(renderer, here, warnings, False, effects_of(scene).as_dict())


def room_for_both(scene: Scene) -> bool:
    """Whether what one renderer holds may stay while another is made. GPUs have little memory, and build quickly."""
    structures = 2.0  # as large as what they hold, or smaller
    return scene.settings.device == "CPU" and (1.0 + structures) * scene_bytes(scene) < available_bytes()

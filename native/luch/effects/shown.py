"""What of a scene is drawn: instances, their meshes, and the materials that lie on some primitive of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from luch.effects.programs import Reading, read_program
from luch.scene import Medium, Scene

SHADOW = 32  # RayKind bit of shadow rays, as in Object.visibility
_BLOCK = 1 << 20  # slots that are counted at a time: counting widens them to 8 bytes each


@dataclass
class Surface:
    """A material of the scene, read."""

    name: str
    reading: Reading
    traits: dict[str, str]  # what its closures have -> the fact that says so
    transparent_shadows: bool
    sampled_as_light: bool
    triangles: int = 0  # that show it, over all instances
    spheres: int = 0
    curves: int = 0
    blocks_light: bool = False  # some object with it is seen by shadow rays
    volume: Medium | None = None  # behind it

    @property
    def title(self) -> str:
        return f'material "{self.name}"'


@dataclass
class Shown:
    """What every effect is decided from."""

    scene: Scene
    surfaces: list[Surface] = field(default_factory=list)  # that are on some triangle, sphere or curve
    idle: list[Surface] = field(default_factory=list)  # on none
    uses: dict[int, int] = field(default_factory=dict)  # mesh -> instances of it that are drawn
    holdouts: list[str] = field(default_factory=list)  # objects
    shadow_catchers: list[str] = field(default_factory=list)


def look_at(scene: Scene) -> Shown:
    """Reads every program and counts what is drawn. Raises ValueError if a program is damaged."""
    shown = Shown(scene)
    aovs = frozenset(name for name, _ in scene.film.aovs)
    surfaces = [
        Surface(
            material.name,
            reading := read_program(material.surface, aovs),
            _traits(reading),
            material.transparent_shadows,
            material.emission_sampling != "NONE",
            volume=material.volume,
        )
        for material in scene.materials
    ]
    _count(shown, surfaces)
    for surface in surfaces:
        drawn = surface.triangles or surface.spheres or surface.curves
        (shown.surfaces if drawn else shown.idle).append(surface)
    return shown


def _traits(reading: Reading) -> dict[str, str]:
    traits: dict[str, str] = {}
    for closure in reading.closures:
        for name, fact in closure.traits().items():
            traits.setdefault(name, fact)
    if "transparency" in traits and len({closure.name for closure in reading.closures} - {"CLOSURE_EMISSION"}) > 1:
        traits["transparency"] = _alpha(reading) or traits["transparency"]
    return traits


def _alpha(reading: Reading) -> str:
    """What lies beside something else is mixed with it: alpha, as Principled and Mix Shader have it."""
    through = [closure.vector("weight") for closure in reading.closures if closure.name == "CLOSURE_TRANSPARENT"]
    if not through:  # a thin wall
        return ""
    known = [sum(weight) / 3.0 for weight in through if weight is not None]
    return f"has alpha {1.0 - sum(known):.3g}" if len(known) == len(through) else "has alpha"


def _count(shown: Shown, surfaces: list[Surface]) -> None:
    scene = shown.scene
    if scene.instances is None:
        return
    slots: dict[int, NDArray[np.int64]] = {}
    times = np.bincount(scene.instances.object, minlength=len(scene.objects))
    for subject, count in zip(scene.objects, times.tolist(), strict=False):
        if not count or not subject.visibility or subject.mesh >= len(scene.meshes):
            continue
        if subject.mesh not in slots:
            slots[subject.mesh] = _by_slot(scene.meshes[subject.mesh].material_slots)
        shown.uses[subject.mesh] = shown.uses.get(subject.mesh, 0) + count
        if subject.holdout:
            shown.holdouts.append(subject.name)
        if subject.shadow_catcher:
            shown.shadow_catchers.append(subject.name)
        for slot, triangles in enumerate(slots[subject.mesh].tolist()):
            if triangles and subject.materials:
                # A face that names a slot beyond the last shows the last.
                surface = surfaces[subject.materials[min(slot, len(subject.materials) - 1)]]
                surface.triangles += triangles * count
                surface.blocks_light |= bool(subject.visibility & SHADOW)
        spheres = scene.meshes[subject.mesh].spheres
        if spheres is not None and len(spheres) and subject.materials:  # all show the first slot
            surface = surfaces[subject.materials[0]]
            surface.spheres += len(spheres) * count
            surface.blocks_light |= bool(subject.visibility & SHADOW)
        curves = scene.meshes[subject.mesh].curves
        if curves is not None and subject.materials:
            for slot, number in enumerate(_by_slot(curves.material_slots).tolist()):
                surface = surfaces[subject.materials[min(slot, len(subject.materials) - 1)]]
                surface.curves += number * count
                surface.blocks_light |= bool(number and subject.visibility & SHADOW)


def _by_slot(material_slots: NDArray[np.uint16]) -> NDArray[np.int64]:
    """How many triangles or curves name each material slot, (slots,)."""
    total = np.zeros(0, np.int64)
    for start in range(0, len(material_slots), _BLOCK):
        part = np.bincount(material_slots[start : start + _BLOCK], minlength=len(total))
        part[: len(total)] += total
        total = part
    return total

"""Materials: which one a slot shows, each compiled once."""

from __future__ import annotations

from typing import Any

from luch.scene import Program

from .attributes import wishes
from .context import ExportContext
from .nodes import compile_displacement, compile_material
from .nodes.media import medium_of
from .volumes import clear_surface, is_only_volume

# What an empty slot is called in Cryptomatte's manifest by every engine of Blender.
DEFAULT_NAME = "default_surface"


class MaterialTable:
    """Indices into `Scene.materials`, by Blender material."""

    def __init__(self, context: ExportContext) -> None:
        self._context = context
        self._indices: dict[int, int] = {}
        self._wishes: list[set[str]] = []
        self._displacements: list[Program | None] = []
        self._override: Any = context.view_layer.material_override

    def slots(self, subject: Any, mesh: Any) -> list[int]:
        """Material indices of an object's slots, at least one. An empty slot shows the default material.

        The evaluated mesh knows the materials that modifiers and geometry nodes gave it; the object's own slots
        win where they are linked to the object.
        """
        own, given = subject.material_slots, mesh.materials
        count = max(len(own), len(given), 1)
        return [self.index(self._material(own, given, slot)) for slot in range(count)]

    def index(self, material: Any) -> int:
        """Index into `Scene.materials`; compiles on first sight."""
        material = self._override or material
        key = material.original.session_uid if material else 0
        index = self._indices.get(key)
        if index is None:
            index = self._indices[key] = len(self._context.result.materials)
            compiled = compile_material(material, self._context)
            if material is None:
                compiled.name = DEFAULT_NAME
            else:
                compiled.volume = medium_of(material, f'Material "{material.name}"', self._context)
            if is_only_volume(material):
                compiled.surface = clear_surface()
                compiled.only_volume = True
            self._context.result.materials.append(compiled)
            self._wishes.append(wishes(compiled.surface))
            self._displacements.append(displacement := compile_displacement(material, self._context))
            if displacement is not None:
                self._wishes[-1] |= wishes(displacement)
        return index

    def displacements(self, indices: list[int]) -> list[Program | None]:
        """How these materials move surfaces; empty: none does."""
        found = [self._displacements[index] for index in indices]
        return found if any(program is not None for program in found) else []

    def attributes(self, indices: list[int]) -> set[str]:
        """What these materials read of a mesh."""
        return set().union(*(self._wishes[index] for index in indices))

    @staticmethod
    def _material(own: Any, given: Any, slot: int) -> Any:
        if slot < len(own) and own[slot].link == "OBJECT":
            return own[slot].material
        return given[slot] if slot < len(given) else None

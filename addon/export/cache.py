"""Meshes, point clouds and hair curves kept from frame to frame (Render Properties > Performance > Persistent Data)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from luch.scene import Mesh

from .context import ExportContext
from .curves import export_curves
from .meshes import export_mesh
from .points import export_points


@dataclass
class _Entry:
    mesh: Mesh | None
    wanted: set[str]
    owners: set[int]  # session_uid of the objects and data whose change makes it stale
    generation: int


class MeshCache:
    """Exported meshes by the address of Blender's evaluated mesh.

    An address may be used again for another mesh, so an entry lives only while every frame uses it and no owner of it
    is listed in `depsgraph.updates`.
    """

    def __init__(self) -> None:
        self._entries: dict[int, _Entry] = {}
        self._generation = 0
        self.read_count = 0  # meshes copied out of Blender so far

    def clear(self) -> None:
        """Forget everything."""
        self._entries.clear()

    def begin(self, depsgraph: Any) -> None:
        """Start a frame: forget what changed and what the last frame did not use."""
        changed = {update.id.original.session_uid for update in depsgraph.updates if update.is_updated_geometry}
        self._entries = {
            address: entry
            for address, entry in self._entries.items()
            if entry.generation == self._generation and not (entry.owners & changed)
        }
        self._generation += 1

    def mesh(self, subject: Any, parent: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
        """The exported mesh of an object's evaluated data with at least the wanted attributes; None: nothing to draw."""
        data = subject.data
        address = data.as_pointer()
        entry = self._entries.get(address)
        owners = {datablock.original.session_uid for datablock in (subject, parent, data)}
        if entry is None or not wanted <= entry.wanted:
            wanted = wanted | (entry.wanted if entry else set())
            if subject.type == "POINTCLOUD":
                mesh = export_points(data, wanted, context)
            elif subject.type == "CURVES":
                mesh = export_curves(data, wanted, context)
            else:
                mesh = export_mesh(data, wanted, _undeformed(subject, data), context)
            self.read_count += 1
            entry = self._entries[address] = _Entry(mesh, wanted, owners, self._generation)
        entry.owners |= owners
        entry.generation = self._generation
        return entry.mesh


def _undeformed(subject: Any, data: Any) -> Any:
    """The mesh before modifiers and shape keys, if the evaluated mesh comes of it: only its name tells."""
    original = subject.original.data
    own = original is not None and original.id_type == "MESH" and data.name == original.name
    return original if own and (len(subject.modifiers) or original.shape_keys) else None

"""Meshes, point clouds and hair curves kept from frame to frame (Render Properties > Performance > Persistent Data)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from luch.scene import Mesh

from .context import ExportContext
from .curves import export_curves
from .kept_images import KeptImages
from .meshes import export_mesh
from .particles import export_hair
from .points import export_points

Key = TypeVar("Key")


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
        self._hair: dict[tuple[int, str], _Entry] = {}
        self._generation = 0
        self.images = KeptImages()
        self.read_count = 0  # meshes copied out of Blender so far

    def clear(self) -> None:
        """Forget all meshes."""
        self._entries.clear()
        self._hair.clear()

    def begin(self, depsgraph: Any) -> None:
        """Start a frame: forget what changed and what the last frame did not use."""
        updates = [(update.id.original.session_uid, update.is_updated_geometry) for update in depsgraph.updates]
        changed = {uid for uid, geometry in updates if geometry}
        self._entries = self._lasting(self._entries, changed)
        self._hair = self._lasting(self._hair, changed)
        self._generation += 1
        self.images.begin({uid for uid, _ in updates})

    def _lasting(self, entries: dict[Key, _Entry], changed: set[int]) -> dict[Key, _Entry]:
        return {
            key: entry
            for key, entry in entries.items()
            if entry.generation == self._generation and not (entry.owners & changed)
        }

    def hair(self, subject: Any, modifier: Any, system: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
        """Curves of a particle system, kept for 3D views alone: Blender tells points one by one; None: no hair."""
        if not context.for_view:
            return export_hair(subject, modifier, system, wanted, context)
        key = (subject.original.session_uid, modifier.name)
        entry = self._hair.get(key)
        if entry is None or not wanted <= entry.wanted:
            owners = {datablock.original.session_uid for datablock in (subject, subject.data, system.settings)}
            mesh = export_hair(subject, modifier, system, wanted, context)
            self.read_count += 1
            entry = self._hair[key] = _Entry(mesh, wanted, owners, self._generation)
        entry.generation = self._generation
        return entry.mesh

    def mesh(self, subject: Any, parent: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
        """The exported mesh of an object's evaluated data with at least the wanted attributes; None: nothing to draw."""
        data = subject.data
        address = data.as_pointer()
        entry = self._entries.get(address)
        owners = {datablock.original.session_uid for datablock in (subject, parent, data)}
        if entry is not None and data.original.session_uid not in entry.owners:
            entry = None  # the mesh that was there is gone, and another took its place
        if entry is None or not wanted <= entry.wanted:
            wanted = wanted | (entry.wanted if entry else set())
            if subject.type == "POINTCLOUD":
                mesh = export_points(data, wanted, context)
            elif subject.type == "CURVES":
                mesh = export_curves(data, wanted, context)
            else:
                with _readable(subject, data) as readable:
                    mesh = export_mesh(readable, wanted, _undeformed(subject, data), context)
            self.read_count += 1
            entry = self._entries[address] = _Entry(mesh, wanted, owners, self._generation)
        entry.owners |= owners
        entry.generation = self._generation
        return entry.mesh


@contextmanager
def _readable(subject: Any, data: Any) -> Iterator[Any]:
    """A mesh with arrays: one that is being edited is something else until Blender is asked for a copy."""
    if not data.is_editmode:
        yield data
        return
    copied = subject.to_mesh()
    try:
        copied.calc_loop_triangles()
        yield copied
    finally:
        subject.to_mesh_clear()


def _undeformed(subject: Any, data: Any) -> Any:
    """The mesh before modifiers and shape keys, if the evaluated mesh comes of it: only its name tells."""
    original = subject.original.data
    own = original is not None and original.id_type == "MESH" and data.name == original.name
    return original if own and (len(subject.modifiers) or original.shape_keys) else None

"""Instances: one pass over the dependency graph's instances, a few microseconds each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from luch.scene import Instances, Mesh, Object
from numpy.typing import NDArray

from .cache import MeshCache
from .context import ExportContext
from .derived import object_attributes
from .displacement import Displaced, displace
from .hashes import name_hash
from .lights import export_light
from .materials import MaterialTable
from .motion import MotionRecorder
from .particles import hair_systems
from .told import Instancers, told_wishes
from .visibility import instance_visibility
from .volumes import warn_about_smoke

# Their meshes arrive as instances of their own (Blender 5): exporting these too would double them.
LISTED_AGAIN_AS_MESH = frozenset({"CURVE", "SURFACE", "FONT", "META"})
NOTHING_TO_DRAW = frozenset({"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE", "GREASEPENCIL"})
NOT_SUPPORTED = {  # type -> what it is, the effect that is missing
    "VOLUME": ("a volume of grids", "heterogeneous volumes"),
}
NO_OBJECT = -1
NO_INSTANCER_GENERATED = (1.0, 1.0, 1.0)  # an orco of 1 gives generated 0
NO_INSTANCER_UV = (0.0, 0.0)


def export_instances(
    context: ExportContext,
    cache: MeshCache,
    recorder: MotionRecorder | None = None,
    shown: Callable[[Any], bool] = lambda item: True,
) -> InstanceCollector:
    """Fill meshes, objects, instances, materials and lamps of the scene. Each mesh is read once.

    recorder: takes note of every instance, where the shutter is open for a time. shown: whether an instance is.
    """
    collector = InstanceCollector(context, cache, recorder)
    for item in context.depsgraph.object_instances:
        if not shown(item):
            continue
        if item.show_self:
            collector.add(item)
        if item.show_particles:
            collector.add_hair(item)
    collector.finish()
    return collector


class InstanceCollector:
    """Rows of `Scene.instances` as they come out of Blender's iterator."""

    def __init__(self, context: ExportContext, cache: MeshCache, recorder: MotionRecorder | None = None) -> None:
        self.kept: NDArray[np.bool_] = np.zeros(0, np.bool_)  # of all rows, those that became instances
        self._recorder = recorder
        self._context = context
        self._cache = cache
        self._materials = MaterialTable(context)
        self._objects: dict[tuple[int, int, int], int] = {}
        self._mesh_indices: dict[int, int] = {}
        self._sources: dict[int, Mesh] = {}  # meshes that are displaced, as they were read
        self._moved: dict[int, Mesh] = {}  # and as they are
        self._hair: dict[tuple[int, int, int], list[int]] = {}
        self._object_column: list[int] = []
        self._matrices: list[bytes] = []  # 16 float32 each, rows
        self._random: list[int] = []
        self._generated: list[float] = []  # 3 each
        self._uv: list[float] = []  # 2 each
        self._solid: bool = context.view_layer.use_solid
        # Objects whose materials ask what an instancer tells each instance, and their likes with other values.
        self._told: dict[int, list[str]] = {}
        self._variants: dict[tuple[int, tuple[Any, ...]], int] = {}
        self._instancers = Instancers(context.scene.frame_current_final)

    def add(self, item: Any) -> None:
        """One instance: a mesh or point cloud to draw, a lamp, or nothing for us."""
        subject = item.object
        kind = subject.type
        if kind == "MESH":
            if self._solid:
                self._add_mesh(item, subject)
        elif kind in ("POINTCLOUD", "CURVES"):  # whatever View Layer > Filter > Surfaces says, as in Cycles
            self._add_mesh(item, subject)
        elif kind == "LIGHT":
            self._add_light(item, subject)
        elif kind in NOT_SUPPORTED:
            what, effect = NOT_SUPPORTED[kind]
            self._context.warn(
                f'Object "{subject.name}" is {what}, which Luch does not draw yet: it is left out.', effect
            )

    def _warn_about_what_is_missing(self, subject: Any) -> None:
        """Say which properties of an object change nothing yet."""
        if subject.is_shadow_catcher and subject.type != "LIGHT":  # of lamps Blender sets it by itself
            self._context.warn(f'Object "{subject.name}" is a shadow catcher; Luch draws it as an ordinary object.')
        if subject.shadow_terminator_shading_offset > 0.0 and subject.type != "LIGHT":
            self._context.warn(f'Object "{subject.name}" has a Shading Offset, which Luch does not draw yet.')
        if any(modifier.type == "SUBSURF" and modifier.use_adaptive_subdivision for modifier in subject.modifiers):
            self._context.warn(
                f'Object "{subject.name}" uses adaptive subdivision; Luch draws it at its modifier\'s render levels.'
            )
        warn_about_smoke(subject, self._context)
        linking = subject.light_linking
        if linking.receiver_collection is not None or linking.blocker_collection is not None:
            self._context.warn(
                f'Object "{subject.name}" uses light linking; Luch lights everything by every light.', "light linking"
            )

    def finish(self) -> None:
        """Turn the columns into arrays."""
        matrix = np.frombuffer(b"".join(self._matrices), dtype=np.float32).reshape(-1, 4, 4)[:, :3].astype(np.float64)
        self.kept = finite = np.isfinite(matrix).all(axis=(1, 2))
        if not finite.all():
            index = self._object_column[int(np.argmin(finite))]
            name = self._context.result.objects[index].name
            self._context.warn(f'Object "{name}": its transform is not finite, so it is left out. Clear its transform.')
        # Signed in Python, 32 random bits in Blender; all ones is exactly 1.
        random = np.array(self._random, dtype=np.int64) & 0xFFFFFFFF
        self._context.result.instances = Instances(
            object=np.array(self._object_column, dtype=np.uint32)[finite],
            matrix=matrix[finite],
            random=(random * np.float64(1.0 / 0xFFFFFFFF)).astype(np.float32)[finite],
            generated=(np.array(self._generated, dtype=np.float32).reshape(-1, 3) * np.float32(0.5) - np.float32(0.5))[
                finite
            ],
            uv=np.array(self._uv, dtype=np.float32).reshape(-1, 2)[finite],
        )

    def _add_mesh(self, item: Any, subject: Any) -> None:
        is_instance = item.is_instance
        parent = item.parent if is_instance else subject
        source = item.instance_object if is_instance else subject
        key = (subject.data.as_pointer(), source.as_pointer(), parent.as_pointer())
        index = self._objects.get(key)
        if index is None:
            index = self._objects[key] = self._add_object(subject, parent)
        if is_instance and index in self._told:
            index = self._variant(item, index)
        self._add_row(item, subject, parent, index)

    def _variant(self, item: Any, index: int) -> int:
        """The object with what its instancer tells this instance."""
        told = self._instancers.tell(item, self._told[index])
        key = (index, tuple(told.values()))
        if key not in self._variants:
            objects = self._context.result.objects
            self._variants[key] = len(objects)
            objects.append(replace(objects[index], attributes={**objects[index].attributes, **told}))
        return self._variants[key]

    def add_hair(self, item: Any) -> None:
        """Particle hair of an instance: an object of its own for each system."""
        subject = item.object
        if subject.type != "MESH" or not (systems := hair_systems(subject, self._context.for_view)):
            return
        parent = item.parent if item.is_instance else subject
        source = item.instance_object if item.is_instance else subject
        key = (subject.data.as_pointer(), source.as_pointer(), parent.as_pointer())
        if key not in self._hair:
            self._hair[key] = [self._add_object(subject, parent, system) for system in systems]
        for index, (modifier, _) in zip(self._hair[key], systems, strict=True):
            self._add_row(item, subject, parent, index, modifier.name)

    def _add_row(self, item: Any, subject: Any, parent: Any, index: int, modifier: str = "") -> None:
        if index == NO_OBJECT:
            return
        if self._recorder is not None:
            mesh = self._context.result.objects[index].mesh
            self._recorder.note(item, subject, parent, len(self._object_column), mesh, modifier)
        is_instance = item.is_instance
        self._object_column.append(index)
        # Vectors of the iterator point into it: only copies may be kept.
        self._matrices.append(bytes(item.matrix_world))
        if is_instance:
            self._random.append(item.random_id)
            self._generated.extend(item.orco)
            self._uv.extend(item.uv)
        else:
            self._random.append(name_hash(subject.name))
            self._generated.extend(NO_INSTANCER_GENERATED)
            self._uv.extend(NO_INSTANCER_UV)

    def _add_object(self, subject: Any, parent: Any, hair: tuple[Any, Any] | None = None) -> int:
        visibility, holdout = instance_visibility(subject, parent, self._view_layer())
        if visibility == 0:
            return NO_OBJECT
        slots = self._materials.slots(subject, subject.data)
        mesh = self._hair_index(subject, hair, slots) if hair else self._mesh_index(subject, parent, slots)
        if mesh == NO_OBJECT:
            return NO_OBJECT
        result = self._context.result
        # A face that names a slot beyond the last shows the last.
        drawn = result.meshes[mesh]
        used = drawn.material_slots if drawn.curves is None else drawn.curves.material_slots
        missing = int(used.max(initial=0)) + 1 - len(slots)
        slots += [slots[-1]] * max(0, missing)
        result.objects.append(
            Object(
                name=subject.name,
                mesh=mesh,
                materials=slots,
                pass_index=subject.pass_index,
                color=tuple(subject.color),
                visibility=visibility,
                holdout=holdout,
                shadow_catcher=subject.is_shadow_catcher,
                shadow_terminator=subject.shadow_terminator_geometry_offset,
                lightgroup=subject.lightgroup or parent.lightgroup,
                asset=asset_name(subject),
                attributes=object_attributes(self._materials.attributes(slots), subject, parent),
            )
        )
        self._warn_about_what_is_missing(subject)
        index = len(result.objects) - 1
        if wishes := told_wishes(result.objects[index].attributes):
            self._told[index] = wishes
        return index

    def _hair_index(self, subject: Any, hair: tuple[Any, Any], slots: list[int]) -> int:
        mesh = self._cache.hair(subject, *hair, self._materials.attributes(slots), self._context)
        if mesh is None:
            return NO_OBJECT
        self._context.result.meshes.append(mesh)
        return len(self._context.result.meshes) - 1

    def _view_layer(self) -> Any:
        """The original view layer: what collection flags are asked of."""
        scene = self._context.scene.original
        return scene.view_layers[self._context.view_layer.name]

    def _mesh_index(self, subject: Any, parent: Any, slots: list[int]) -> int:
        wanted = self._materials.attributes(slots)
        pointer = subject.data.as_pointer()
        index = self._mesh_indices.get(pointer)
        meshes = self._context.result.meshes
        mesh: Mesh | None
        if index is None:
            mesh = self._cache.mesh(subject, parent, wanted, self._context)
            index = self._mesh_indices[pointer] = NO_OBJECT if mesh is None else len(meshes)
            if mesh is not None:
                meshes.append(mesh)
        elif index != NO_OBJECT:  # another object's materials may ask for more
            mesh = self._cache.mesh(subject, parent, wanted, self._context)
            if mesh is not None and mesh is not self._sources.get(index):
                meshes[index] = mesh
        if index != NO_OBJECT and subject.type == "MESH" and meshes[index] is not self._moved.get(index):
            self._displace(index, subject, slots)
        return index

    def _displace(self, index: int, subject: Any, slots: list[int]) -> None:
        """Move the vertices of a mesh that was read, if its materials do so."""
        programs = self._materials.displacements(slots)
        if not programs:
            return
        result = self._context.result
        matrix = np.array(subject.matrix_world, dtype=np.float64)[:3]
        if not np.isfinite(matrix).all():
            return
        random = name_hash(subject.name) / 0xFFFFFFFF
        location = (float(matrix[0, 3]), float(matrix[1, 3]), float(matrix[2, 3]))
        owner = Displaced(matrix, location, tuple(subject.color), float(subject.pass_index), random)
        source = result.meshes[index]
        result.meshes[index] = displace(source, programs, owner, result.images, self._materials.attributes(slots))
        self._sources[index], self._moved[index] = source, result.meshes[index]
        self._context.displaced.add(index)

    def _add_light(self, item: Any, subject: Any) -> None:
        parent = item.parent if item.is_instance else subject
        visibility, _ = instance_visibility(subject, parent, self._view_layer())
        rows = np.frombuffer(bytes(item.matrix_world), dtype=np.float32).reshape(4, 4)[:3]
        if not np.isfinite(rows).all():
            self._context.warn(f'Light "{subject.name}": its transform is not finite, so it is left out.')
            return
        seed = item.random_id if item.is_instance else name_hash(subject.name)
        random = (seed & 0xFFFFFFFF) / 0xFFFFFFFF
        self._warn_about_what_is_missing(subject)
        light = export_light(subject, rows.astype(np.float64), random, visibility, self._context)
        if np.isfinite([light.power, *light.color]).all():
            light.lightgroup = subject.lightgroup or parent.lightgroup
            self._context.result.lights.append(light)
        else:
            self._context.warn(f'Light "{subject.name}": its power is not finite, so it is left out.')


def asset_name(subject: Any) -> str:
    """The name at the top of an object's chain of parents: Cryptomatte's asset."""
    while subject.parent is not None:
        subject = subject.parent
    return str(subject.name)

"""Motion while the shutter is open: the frame is evaluated anew at each time that somebody asks for, as Cycles does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from luch.scene import F32, F64, Camera, CameraMotion, InstanceMotion, Mesh, Shutter

from .context import ExportContext
from .hair_motion import HairShape, read_hair, tell_hair
from .shapes import MeshTopology, export_shape, read_velocity

CURVE_POINTS = 256  # of the shutter's curve, evenly spaced
MOST_KEYS = 129
# Where the shutter's middle lies, in lengths of it from the frame.
MIDDLE = {"START": 0.5, "CENTER": 0.0, "END": -0.5}


def export_shutter(context: ExportContext, engine: Any) -> Shutter | None:
    """When the shutter is open; None: the picture is of an instant. engine: who can evaluate other times."""
    render = context.scene.render
    if not (render.use_motion_blur and context.view_layer.use_motion_blur):
        return None
    if engine is None:
        context.warn(
            f'Scene "{context.scene.name}" has motion blur, which only a render can see: the frame is sharp.',
            "motion blur",
        )
        return None
    if not render.motion_blur_shutter > 0.0:
        return None
    cycles = getattr(context.scene, "cycles", None)
    rolling = cycles is not None and cycles.rolling_shutter_type != "NONE"
    return Shutter(
        length=render.motion_blur_shutter,
        position=render.motion_blur_position,
        curve=_curve(render.motion_blur_shutter_curve),
        rolling=cycles.rolling_shutter_duration if rolling else None,
    )


def _curve(mapping: Any) -> F32 | None:
    mapping.initialize()
    curve = mapping.curves[0]
    open_at = np.array([mapping.evaluate(curve, x) for x in np.linspace(0.0, 1.0, CURVE_POINTS)], np.float32)
    return None if (open_at == open_at[0]).all() else open_at


def motion_keys(subject: Any, parent: Any) -> int:
    """At how many times an object is looked at, at least 3; 0: it is told to stand still. Its instancer decides too."""
    steps = 1
    for owner in (subject,) if parent == subject else (subject, parent):
        settings = getattr(owner, "cycles", None)
        if settings is None:
            continue
        if not settings.use_motion_blur:
            return 0
        steps = max(steps, settings.motion_steps)
    # An odd number, so that one key is the shutter's middle, and one more than a power of 2, so that objects of
    # different steps share times.
    return min((2 << (steps - 1)) + 1, MOST_KEYS)


def _may_deform(subject: Any, parent: Any) -> bool:
    """Something could change its mesh within the frame, and its settings allow that it shows."""
    for owner in (subject, parent):
        settings = getattr(owner, "cycles", None)
        if settings is not None and not settings.use_deform_motion:
            return False
    data = subject.original.data
    keys = data is not None and getattr(data, "shape_keys", None) is not None
    return bool(len(subject.modifiers) or keys or (parent != subject and len(parent.modifiers)))


@dataclass
class _Shape:
    """A mesh that may change its shape."""

    owner: str
    keys: int
    topology: MeshTopology
    positions: dict[float, F32]  # by time
    normals: dict[float, F32]


class MotionRecorder:
    """What is noted of every instance while the scene is exported, and looked up again at other times."""

    def __init__(self, context: ExportContext, engine: Any, shutter: Shutter) -> None:
        self._context = context
        self._engine = engine
        self.shutter = shutter
        scene = context.scene
        self._frame: float = scene.frame_current + scene.frame_subframe
        self._middle = self._frame + MIDDLE[shutter.position] * shutter.length
        self._rows: dict[
            tuple[Any, ...], list[int]
        ] = {}  # instance -> rows of the exporter's columns: itself, its hair
        self._keys: list[int] = []  # by row
        self._mesh_of: list[int] = []  # by row, index into Scene.meshes
        self._shapes: dict[int, _Shape | HairShape] = {}  # by index into Scene.meshes
        self._matrices: dict[int, dict[float, bytes]] = {}  # of a row, by time
        self._still: dict[str, None] = {}

    def note(self, item: Any, subject: Any, parent: Any, row: int, mesh: int, modifier: str = "") -> None:
        """An instance that was exported. row: its place among all; mesh: index into Scene.meshes; modifier: the name of
        that which grows it, where it is particle hair."""
        keys = motion_keys(subject, parent)
        self._rows.setdefault(_identity(item), []).append(row)
        self._keys.append(keys)
        self._mesh_of.append(mesh)
        if not keys:
            self._still[f'object "{subject.name}": its Motion Blur is disabled'] = None
        elif mesh not in self._shapes and _may_deform(subject, parent):
            if self._context.result.meshes[mesh].curves is not None:
                self._shapes[mesh] = HairShape(subject.name, keys, modifier)
            elif mesh in self._context.displaced:
                self._still[f'object "{subject.name}": its surface is displaced, and does not change its shape'] = None
            elif subject.type == "MESH":
                self._note_shape(subject, keys, mesh)

    def _note_shape(self, subject: Any, keys: int, mesh: int) -> None:
        result = self._context.result.meshes[mesh]
        topology = MeshTopology.of(subject.data)
        if len(topology.faces) != len(result.triangles):
            return  # some are left out, and a warning says why
        shape = _Shape(subject.name, keys, topology, {0.0: result.positions}, {})
        if result.normals is not None:
            shape.normals[0.0] = result.normals
        velocity = read_velocity(subject.data)
        if velocity is not None:
            shape.keys = 3
            step = velocity * np.float32(0.5 * self.shutter.length)
            for time in (-1.0, 1.0):
                shape.positions[time] = result.positions + np.float32(time) * step
                if result.normals is not None:
                    shape.normals[time] = result.normals
        self._shapes[mesh] = shape

    @contextmanager
    def at_middle(self) -> Iterator[None]:
        """Blender at the shutter's middle; afterwards it is back at the frame, whatever happened."""
        try:
            if self._middle != self._frame:
                self._set(0.0)
            yield
        finally:
            self._engine.frame_set(math.floor(self._frame), self._frame - math.floor(self._frame))

    def _set(self, time: float) -> None:
        """time: -1 when the shutter opens, 1 when it closes."""
        frame = self._middle + time * 0.5 * self.shutter.length
        self._engine.frame_set(math.floor(frame), frame - math.floor(frame))

    def follow(self, camera: Camera, evaluated_camera: Any, matrix_of: Any) -> None:
        """Look at everything at every other time. evaluated_camera(): at the current time; matrix_of(it): its place."""
        seen = evaluated_camera()
        camera_keys = motion_keys(seen, seen)
        if not camera_keys:
            self._still["the camera's Motion Blur is disabled"] = None
        camera.matrix, camera.lens_mm = matrix_of(seen), seen.data.lens
        places = {0.0: camera.matrix}
        lenses = {0.0: camera.lens_mm}
        wanted = {count for count in (*self._keys, *(s.keys for s in self._shapes.values()), camera_keys) if count}
        times = sorted({time for count in wanted for time in _times(count)} - {0.0})
        for time in times:
            self._set(time)
            seen = evaluated_camera()
            places[time], lenses[time] = matrix_of(seen), seen.data.lens
            self._look(time)
        self._tell_camera(camera, camera_keys, places, lenses)

    @staticmethod
    def _tell_camera(camera: Camera, keys: int, places: dict[float, F64], lenses: dict[float, float]) -> None:
        own = [places[time] for time in _times(keys)] if keys else []
        moves = any(not np.array_equal(matrix, camera.matrix) for matrix in own)
        ends = (lenses.get(-1.0, camera.lens_mm), lenses.get(1.0, camera.lens_mm))
        zooms = camera.kind == "PERSP" and ends != (camera.lens_mm, camera.lens_mm)
        if moves or zooms:
            camera.motion = CameraMotion(np.stack(own) if moves else camera.matrix[None], ends if zooms else None)

    def _look(self, time: float) -> None:
        read: set[int] = set()
        for item in self._context.depsgraph.object_instances:
            if item.object.type not in ("MESH", "POINTCLOUD", "CURVES"):
                continue
            for row in self._rows.get(_identity(item), ()):
                if self._keys[row] and time in _times(self._keys[row]):
                    self._matrices.setdefault(row, {})[time] = bytes(item.matrix_world)
                mesh = self._mesh_of[row]
                shape = self._shapes.get(mesh)
                if shape is None or mesh in read or time not in _times(shape.keys):
                    continue
                read.add(mesh)
                if isinstance(shape, HairShape):
                    self._read_hair(mesh, shape, item.object, time)
                elif time not in shape.positions:
                    self._read_shape(mesh, shape, item.object.data, time)

    def _read_hair(self, mesh: int, shape: HairShape, subject: Any, time: float) -> None:
        points, curves = read_hair(subject, shape, self._context), self._context.result.meshes[mesh].curves
        if points is None or curves is None or points.shape != curves.points.shape:
            self._context.warn(
                f'Object "{shape.owner}": its hair has other curves or points at other times of this frame, so its'
                " change of shape is not blurred. Keep their number."
            )
            del self._shapes[mesh]
            return
        shape.points[time] = points

    def _read_shape(self, mesh: int, shape: _Shape, data: Any, time: float) -> None:
        found = export_shape(data, shape.topology, self._context.result.meshes[mesh])
        if found is None:
            self._context.warn(
                f'Object "{shape.owner}": its mesh has other vertices or faces at other times of this frame, so its'
                " change of shape is not blurred. Give it a velocity attribute, or keep its topology."
            )
            del self._shapes[mesh]
            return
        shape.positions[time], normals = found
        if normals is not None:
            shape.normals[time] = normals

    def finish(self, kept: Any) -> None:
        """Fill in what moved. kept: bool (rows,), which of the exporter's rows became instances."""
        result = self._context.result
        self.shutter.still = list(self._still)
        result.shutter = self.shutter
        for index, shape in self._shapes.items():
            mesh = result.meshes[index]
            if isinstance(shape, HairShape):
                if mesh.curves is not None:
                    tell_hair(mesh.curves, shape, _times(shape.keys))
            else:
                _tell_shape(mesh, shape)
        if result.instances is None:
            return
        place = np.cumsum(kept) - 1
        rows, counts, matrices = [], [], []
        for row, seen in sorted(self._matrices.items()):
            own = result.instances.matrix[place[row]] if kept[row] else None
            if own is None or not (keys := _keys_of(own, seen, self._keys[row])):
                continue
            rows.append(int(place[row]))
            counts.append(len(keys))
            matrices += keys
        if rows:
            result.instances.motion = InstanceMotion(
                np.array(rows, np.uint32), np.array(counts, np.uint32), np.stack(matrices)
            )


def _identity(item: Any) -> tuple[Any, ...]:
    """What an instance is known by at every time."""
    if not item.is_instance:
        return (item.object.original.session_uid,)
    source = item.instance_object
    return (item.parent.original.session_uid, source.original.session_uid, *item.persistent_id)


def _times(keys: int) -> tuple[float, ...]:
    """From -1, when the shutter opens, to 1, when it closes."""
    return tuple(2.0 * k / (keys - 1) - 1.0 for k in range(keys))


def _keys_of(middle: F64, seen: dict[float, bytes], count: int) -> list[F64]:
    """An instance's matrices; where it was not there, that of the middle. Empty: it stands still."""
    keys = []
    for time in _times(count):
        matrix = middle
        if time in seen:
            matrix = np.frombuffer(seen[time], np.float32).reshape(4, 4)[:3].astype(np.float64)
        keys.append(matrix if np.isfinite(matrix).all() else middle)
    return keys if any(not np.array_equal(matrix, middle) for matrix in keys) else []


def _tell_shape(mesh: Mesh, shape: _Shape) -> None:
    middle = shape.positions[0.0]
    positions = [shape.positions.get(time, middle) for time in _times(shape.keys)]
    if all(np.array_equal(p, middle) for p in positions) or not all(np.isfinite(p).all() for p in positions):
        return
    mesh.motion_positions = np.stack(positions)
    if mesh.normals is not None:
        mesh.motion_normals = np.stack([shape.normals.get(time, mesh.normals) for time in _times(shape.keys)])

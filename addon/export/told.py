"""What an instance is told by its instancer: attributes of geometry nodes' instances, and its particle.

Each is found by the numbers that Blender gives an instance (`persistent_id`, the innermost level first): a place in its
particle system, or in the instances that the instancer's geometry holds.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from luch.scene import F32
from numpy.typing import NDArray

from .attributes import read
from .derived import property_color
from .hashes import random_of

Told = tuple[float, float, float, float]

INSTANCER, PARTICLE = "instancer:", "particle:"  # before a name among the wishes of a material
NOTHING: Told = (0.0, 0.0, 0.0, 0.0)
NO_LEVEL = 0x7FFFFFFF  # fills the levels of persistent_id that there are not
PARTICLE_VALUES = ("Index", "Random", "Age", "Lifetime", "Location", "Size", "Velocity", "Angular Velocity")


def told_wishes(wanted: Iterable[str]) -> list[str]:
    """Of what materials read, that which instances of one object may differ in."""
    return sorted(wish for wish in wanted if wish.startswith((INSTANCER, PARTICLE)))


class Instancers:
    """What instancers of one frame hold, each read once."""

    def __init__(self, time: float) -> None:
        self._time = time  # frame, with its fraction
        self._levels: dict[tuple[int, ...], _Level | None] = {}
        self._columns: dict[tuple[tuple[int, ...], str], NDArray[np.float32] | None] = {}

    def tell(self, item: Any, wishes: Iterable[str]) -> dict[str, Told]:
        """Values of an instance for those of the wishes that its instancer decides."""
        result: dict[str, Told] = {}
        particle = None
        for wish in wishes:
            if wish.startswith(PARTICLE):
                particle = particle or particle_values(item, self._time)
                result[wish] = particle[wish.removeprefix(PARTICLE)]
            else:
                found = self._attribute(item, wish.removeprefix(INSTANCER))
                if found is not None:
                    result[wish] = found
        return result

    def _attribute(self, item: Any, name: str) -> Told | None:
        """Of the innermost instances that have it; then of the particles' settings."""
        numbers = [number for number in item.persistent_id if number != NO_LEVEL]
        key: tuple[int, ...] = (item.parent.original.session_uid,)
        level = self._level(key, item.parent)
        found = None
        for number in reversed(numbers):
            if level is None or (row := level.rows.get(number)) is None:
                break
            column = self._column(key, level, name)
            if column is not None:
                red, green, blue, alpha = column[row].tolist()
                found = (red, green, blue, alpha)
            key = (*key, int(level.references[row]))
            level = self._level(key, level.geometries[key[-1]])
        system = item.particle_system
        return found or (property_color((system.settings,), name) if system is not None else None)

    def _level(self, key: tuple[int, ...], owner: Any) -> _Level | None:
        if key not in self._levels:
            self._levels[key] = _Level.of(owner)
        return self._levels[key]

    def _column(self, key: tuple[int, ...], level: _Level, name: str) -> NDArray[np.float32] | None:
        if (key, name) not in self._columns:
            self._columns[key, name] = as_colors(level.cloud.attributes.get(name))
        return self._columns[key, name]


class _Level:
    """Instances that a geometry holds."""

    def __init__(self, geometry: Any, cloud: Any) -> None:
        self.geometry = geometry  # keeps what `cloud` shows
        self.cloud = cloud
        self.geometries: list[Any] = list(geometry.instance_references())
        count = len(cloud.points)
        self.references = read(cloud.attributes[".reference_index"].data, "value", count, np.int32)
        self.rows = {number: row for row, number in enumerate(_numbers(cloud, count))}

    @classmethod
    def of(cls, owner: Any) -> _Level | None:
        """owner: an evaluated object, or a geometry that is instanced; None: it holds no instances."""
        if hasattr(owner, "evaluated_geometry"):
            try:
                owner = owner.evaluated_geometry()
            except (RuntimeError, TypeError):  # of a kind that has none
                return None
        cloud = owner.instances_pointcloud() if hasattr(owner, "instances_pointcloud") else None
        return cls(owner, cloud) if cloud is not None and len(cloud.points) else None


def _numbers(cloud: Any, count: int) -> list[int]:
    """What instances are known by: the attribute `id` where it tells them apart, else their order."""
    layer = cloud.attributes.get("id")
    if layer is not None and layer.data_type == "INT":
        given: list[int] = read(layer.data, "value", count, np.int32).tolist()
        if len(set(given)) == count:
            return given
    return list(range(count))


def as_colors(layer: Any) -> F32 | None:
    """Values of an attribute as colours, float32 (N, 4): a number is grey, a vector opaque."""
    if layer is None:
        return None
    count = len(layer.data)
    if layer.data_type in ("FLOAT_COLOR", "BYTE_COLOR"):
        return read(layer.data, "color", 4 * count, np.float32).reshape(-1, 4)
    result = np.ones((count, 4), np.float32)
    if layer.data_type in ("FLOAT_VECTOR", "FLOAT2"):
        width = 3 if layer.data_type == "FLOAT_VECTOR" else 2
        result[:, 2] = 0.0
        result[:, :width] = read(layer.data, "vector", width * count, np.float32).reshape(-1, width)
    elif layer.data_type in ("FLOAT", "INT", "INT8", "BOOLEAN"):
        kind = {"FLOAT": np.float32, "BOOLEAN": np.bool_}.get(layer.data_type, np.int32)
        result[:, :3] = read(layer.data, "value", count, kind)[:, None]
    else:
        return None
    return result


def particle_values(item: Any, time: float) -> dict[str, Told]:
    """Particle Info of an instance; zeros where no particle made it (a child has none of its own either)."""
    system = item.particle_system
    index = item.persistent_id[0]
    if system is None or not 0 <= index < len(system.particles):
        return {name: NOTHING for name in PARTICLE_VALUES} | {"Random": _number(random_of(0))}
    particle = system.particles[index]
    return {
        "Index": _number(index),
        "Random": _number(random_of(index)),
        "Age": _number(time - particle.birth_time),
        "Lifetime": _number(particle.lifetime),
        "Location": _vector(particle.location),
        "Size": _number(particle.size),
        "Velocity": _vector(particle.velocity),
        "Angular Velocity": _vector(particle.angular_velocity),
    }


def _number(value: float) -> Told:
    return (float(value), float(value), float(value), 1.0)


def _vector(value: Any) -> Told:
    x, y, z = value
    return (float(x), float(y), float(z), 1.0)

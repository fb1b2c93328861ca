"""Point clouds: Blender's evaluated arrays as spheres in object space."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import Attribute, Mesh

from .attributes import TYPES, read
from .context import ExportContext
from .places import read_places

DEFAULT_RADIUS = 0.01  # metres, of a cloud without the attribute
# Cycles keeps it for itself: an Attribute node reads 0, Point Info tells it.
NOT_FOR_SHADERS = frozenset({"radius"})


def export_points(cloud: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
    """Spheres of an evaluated point cloud; None if it has no point.

    wanted: what its material reads (see attributes.wishes).
    """
    count = len(cloud.points)
    if count == 0:
        return None
    # Left out where it lies: Point Info > Random counts it.
    spheres = read_places(cloud, f'Point cloud "{cloud.name}"', DEFAULT_RADIUS, "left out", context)
    none = np.zeros((0, 3), np.float32)
    return Mesh(
        name=cloud.name,
        positions=none,
        triangles=none.astype(np.uint32),
        material_slots=np.zeros(0, np.uint16),
        spheres=spheres,
        attributes=_attributes(cloud, wanted, count, context),
        # Generated coordinates of points are those of the object: (p - 1/2) / (1/2) / 2 + 1/2.
        texture_location=(0.5, 0.5, 0.5),
        texture_size=(0.5, 0.5, 0.5),
    )


def _attributes(cloud: Any, wanted: set[str], count: int, context: ExportContext) -> dict[str, Attribute]:
    result = {}
    for name in sorted(wanted - NOT_FOR_SHADERS):
        layer = cloud.attributes.get(name)
        if layer is None:
            continue
        kind = TYPES.get(layer.data_type)
        if kind is None or layer.domain != "POINT":
            context.warn(
                f'Point cloud "{cloud.name}": attribute "{name}" ({layer.data_type} per {layer.domain.lower()}) cannot'
                " be read by shaders and gives 0. Convert it with Attribute > Convert."
            )
            continue
        value, channels, dtype = kind
        data = read(layer.data, value, channels * count, dtype).reshape(-1, channels)
        result[name] = Attribute(np.ascontiguousarray(data, dtype=np.float32), "SPHERE")
    return result

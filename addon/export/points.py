"""Point clouds: Blender's evaluated arrays as spheres in object space."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F32, Attribute, Mesh

from .attributes import TYPES, read
from .context import ExportContext

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
    spheres = np.empty((count, 4), np.float32)
    spheres[:, :3] = read(cloud.attributes["position"].data, "vector", 3 * count, np.float32).reshape(-1, 3)
    spheres[:, 3] = _radii(cloud, count, context)
    _shrink_invalid(spheres, cloud.name, context)
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


def _radii(cloud: Any, count: int, context: ExportContext) -> F32:
    layer = cloud.attributes.get("radius")
    kind = TYPES.get(layer.data_type) if layer is not None and layer.domain == "POINT" else None
    if kind is None or kind[1] != 1:
        if layer is not None:
            context.warn(
                f'Point cloud "{cloud.name}": the attribute "radius" is not a number per point ({layer.data_type}), so'
                f" every radius is {DEFAULT_RADIUS} m. Convert it with Attribute > Convert."
            )
        return np.full(count, DEFAULT_RADIUS, np.float32)
    value, _, dtype = kind
    return read(layer.data, value, count, dtype).astype(np.float32)


def _shrink_invalid(spheres: F32, name: str, context: ExportContext) -> None:
    """Points that cannot be drawn keep their place, which Point Info > Random counts, with radius 0."""
    finite = np.isfinite(spheres).all(axis=1)
    if not finite.all():
        context.warn(
            f'Point cloud "{name}": point {int(np.argmin(finite))} is not finite; {int((~finite).sum())} such points'
            " are left out. Remove them with Delete Geometry in geometry nodes."
        )
        spheres[~finite] = 0.0
    np.maximum(spheres[:, 3], 0.0, out=spheres[:, 3])  # below zero Cycles draws nothing


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

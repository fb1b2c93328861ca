"""Places and radii of points, which point clouds and hair curves have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F32

from .attributes import TYPES, read
from .context import ExportContext


def read_places(data: Any, title: str, default_radius: float, fate: str, context: ExportContext) -> F32:
    """Place and radius of every point of an evaluated data-block, (P, 4).

    Points that are not finite keep their number, with radius 0, and are named. title: of the data-block, for warnings;
    default_radius: metres, where it has no radii; fate: what the warning says becomes of such points.
    """
    count = len(data.points)
    points = np.empty((count, 4), np.float32)
    points[:, :3] = read(data.attributes["position"].data, "vector", 3 * count, np.float32).reshape(-1, 3)
    points[:, 3] = _radii(data, count, title, default_radius, context)
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        context.warn(
            f"{title}: point {int(np.argmin(finite))} is not finite; {int((~finite).sum())} such points are {fate}."
            " Remove them with Delete Geometry in geometry nodes."
        )
        points[~finite] = 0.0
    np.maximum(points[:, 3], 0.0, out=points[:, 3])  # below zero Cycles draws nothing
    return points


def _radii(data: Any, count: int, title: str, default: float, context: ExportContext) -> F32:
    layer = data.attributes.get("radius")
    kind = TYPES.get(layer.data_type) if layer is not None and layer.domain == "POINT" else None
    if kind is None or kind[1] != 1:
        if layer is not None:
            context.warn(
                f'{title}: the attribute "radius" is not a number per point ({layer.data_type} per'
                f" {layer.domain.lower()}), so every radius is {default} m. Convert it with Attribute > Convert."
            )
        return np.full(count, default, np.float32)
    value, _, dtype = kind
    return read(layer.data, value, count, dtype).astype(np.float32)

"""Which rays see an object."""

from __future__ import annotations

from typing import Any

# RayKind in native/include/luch/geometry/ray.h
CAMERA, DIFFUSE, GLOSSY, TRANSMISSION, VOLUME, SHADOW = 1, 2, 4, 8, 16, 32

PROPERTIES = {
    "visible_camera": CAMERA,
    "visible_diffuse": DIFFUSE,
    "visible_glossy": GLOSSY,
    "visible_transmission": TRANSMISSION,
    "visible_volume_scatter": VOLUME,
    "visible_shadow": SHADOW,
}


def ray_visibility(subject: Any) -> int:
    """RayKind bits of Object Properties > Visibility > Ray Visibility."""
    return sum(bit for name, bit in PROPERTIES.items() if getattr(subject, name))


def instance_visibility(subject: Any, parent: Any, view_layer: Any) -> tuple[int, bool]:
    """RayKind bits and holdout of an instance: its own switches, its instancer's, and the collections'."""
    visibility = ray_visibility(subject)
    if parent != subject:
        visibility &= ray_visibility(parent)
    original = parent.original
    holdout = parent.is_holdout or original.holdout_get(view_layer=view_layer)
    if not holdout and original.indirect_only_get(view_layer=view_layer):
        visibility &= ~CAMERA
    return visibility, holdout

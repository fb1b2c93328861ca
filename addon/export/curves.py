"""Hair curves: Blender's evaluated arrays as curves in object space."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F32, U32, Attribute, Curves, Mesh
from numpy.typing import NDArray

from .attributes import TYPES, read
from .context import ExportContext
from .places import read_places

DEFAULT_RADIUS = 0.005  # metres, of curves without the attribute
SURFACE_UV = "surface_uv_coordinate"  # where on the surface that it grows from a curve has its root
# What Curves Info reads; no names of attributes in Blender.
INTERCEPT, LENGTH, RANDOM = "curves:intercept", "curves:length", "curves:random"
GENERATED = "generated"
# Cycles keeps it for itself: an Attribute node reads 0, Curves Info tells its double.
NOT_FOR_SHADERS = frozenset({"radius"})


def export_curves(data: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
    """Curves of an evaluated Curves data-block; None if nothing of it can be drawn.

    wanted: what its materials read (see attributes.wishes).
    """
    if len(data.points) == 0:
        return None
    points = read_points(data, context)
    offsets = np.empty(len(data.curves) + 1, np.int32)
    data.curve_offset_data.foreach_get("value", offsets)
    slots = np.zeros(len(data.curves), np.uint16)  # Blender has no slots of single curves, particle systems have
    result = mesh_of(data.name, Curves(points, offsets[:-1].astype(np.uint32), slots))
    result.attributes = _attributes(data, wanted, context) | derived(result, wanted)
    if SURFACE_UV in result.attributes:
        result.uv_active = SURFACE_UV
    return result


def read_points(data: Any, context: ExportContext) -> F32:
    """Place and radius of every point, (P, 4); those that are not finite have none and are named."""
    return read_places(data, f'Curves "{data.name}"', DEFAULT_RADIUS, "drawn without a radius", context)


def mesh_of(name: str, curves: Curves) -> Mesh:
    """A mesh of curves alone."""
    none = np.zeros((0, 3), np.float32)
    return Mesh(
        name=name,
        positions=none,
        triangles=none.astype(np.uint32),
        material_slots=np.zeros(0, np.uint16),
        curves=curves,
    )


def derived(mesh: Mesh, wanted: set[str]) -> dict[str, Attribute]:
    """What Curves Info reads, and where roots are."""
    assert mesh.curves is not None
    points, first = mesh.curves.points, mesh.curves.first
    result: dict[str, Attribute] = {}
    if GENERATED in wanted:
        result[GENERATED] = Attribute(np.ascontiguousarray(points[first, :3]), "CURVE")
    if INTERCEPT in wanted:
        result[INTERCEPT] = Attribute(_intercepts(points, first)[:, None], "CURVE_POINT")
    if LENGTH in wanted:
        result[LENGTH] = Attribute(_lengths(points, first)[1].astype(np.float32)[:, None], "CURVE")
    if RANDOM in wanted:
        result[RANDOM] = Attribute(random_numbers(len(first))[:, None], "CURVE")
    return result


def _lengths(points: F32, first: U32) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Length of each point's curve up to it, (P,); of each curve, (C,); the curve of each point, (P,)."""
    start = first.astype(np.int64)
    counts = np.diff(np.append(start, len(points)))
    curve = np.repeat(np.arange(len(start)), counts)
    step = np.zeros(len(points))
    step[1:] = np.linalg.norm(np.diff(points[:, :3].astype(np.float64), axis=0), axis=1)
    step[start[counts > 0]] = 0.0
    total = np.cumsum(step)
    so_far = total - total[np.minimum(start, len(points) - 1)][curve]
    return so_far, np.bincount(curve, step, len(start)), curve


def _intercepts(points: F32, first: U32) -> F32:
    """0 at the root to 1 at the tip, by length, float32 (P,)."""
    so_far, length, curve = _lengths(points, first)
    whole = length[curve]
    result: F32 = np.where(whole > 0.0, so_far / np.where(whole > 0.0, whole, 1.0), 0.0).astype(np.float32)
    return result


def random_numbers(count: int) -> F32:
    """A number of each curve by its place in the list, 0..1: those that Blender users know from Cycles."""
    # Bob Jenkins' final mix (lookup3, public domain) of the place and 0.
    with np.errstate(over="ignore"):
        a, b, c = (np.full(count, 0xDEADBEEF + (2 << 2) + 13, np.uint32) for _ in range(3))
        a += np.arange(count, dtype=np.uint32)
        for bits in (14, 11, 25, 16, 4, 14, 24):
            # c from b, a from c, b from a, and again: each round works on the next of the three.
            c, a, b = a, b, _mixed(c, b, bits)
    # The last word mixed is c of lookup3.
    result: F32 = (b.astype(np.float64) * (1.0 / 0xFFFFFFFF)).astype(np.float32)
    return result


def _mixed(word: NDArray[np.uint32], by: NDArray[np.uint32], bits: int) -> NDArray[np.uint32]:
    turned = (by << np.uint32(bits)) | (by >> np.uint32(32 - bits))
    result: NDArray[np.uint32] = (word ^ by) - turned
    return result


def _attributes(data: Any, wanted: set[str], context: ExportContext) -> dict[str, Attribute]:
    result = {}
    for name in sorted((wanted | {SURFACE_UV}) - NOT_FOR_SHADERS):
        layer = data.attributes.get(name)
        if layer is None:
            continue
        kind = TYPES.get(layer.data_type)
        if kind is None or layer.domain not in ("POINT", "CURVE"):
            context.warn(
                f'Curves "{data.name}": attribute "{name}" ({layer.data_type} per {layer.domain.lower()}) cannot be read'
                " by shaders and gives 0. Convert it with Attribute > Convert."
            )
            continue
        value, channels, dtype = kind
        values = read(layer.data, value, channels * len(layer.data), dtype).reshape(-1, channels)
        domain = "CURVE_POINT" if layer.domain == "POINT" else "CURVE"
        result[name] = Attribute(np.ascontiguousarray(values, dtype=np.float32), domain)
    return result

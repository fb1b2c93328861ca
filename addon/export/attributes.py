"""Attributes of meshes: only those that a shader program reads are copied."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import F32, Attribute, Mesh, Program
from luch.shader import ATTRIBUTE_COLOR, ATTRIBUTE_TANGENT, OPS
from numpy.typing import NDArray

from .context import ExportContext
from .derived import derived_attribute
from .tangents import corner_tangents

I32 = NDArray[np.int32]

# Wishes that are no attribute's name in Blender.
ACTIVE_COLOR = "\0color"
GENERATED = "generated"
TANGENT = "tangent"  # of the active UV map; "NAME.tangent": of another
READS_GENERATED = frozenset({"POINT_GENERATED", "TANGENT_RADIAL"})

# Blender's attribute types: name of the value in its items, channels, and the type that is copied without a loop.
TYPES: dict[str, tuple[str, int, Any]] = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, np.bool_),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),  # foreach_get gives it linear
    "QUATERNION": ("value", 4, np.float32),
    "INT32_2D": ("value", 2, np.int32),
}


def read(items: Any, name: str, length: int, dtype: Any) -> NDArray[Any]:
    """A Blender collection's values, copied at memory speed where dtype is Blender's own."""
    values = np.empty(length, dtype=dtype)
    items.foreach_get(name, values)
    return values


def wishes(program: Program) -> set[str]:
    """What a program reads of a mesh: attribute names, and the wishes above."""
    wanted = set(program.attributes)
    names = {info.code: info for info in OPS.values()}
    code, at = program.code, 0
    while at < len(code):
        info, param_count = names[int(code[at])], int(code[at + 1])
        params = at + 2 + info.outputs + info.inputs
        words = {int(word) for word in code[params : params + param_count]}
        if ATTRIBUTE_COLOR in words:
            wanted.add(ACTIVE_COLOR)
        if ATTRIBUTE_TANGENT in words:
            wanted.add(TANGENT)
        if info.name in READS_GENERATED:
            wanted.add(GENERATED)
        at = params + param_count
    return wanted


def add_attributes(
    result: Mesh, mesh: Any, wanted: set[str], corners: I32, faces: I32, undeformed: Any, context: ExportContext
) -> None:
    """Fill the mesh's attributes with what is wanted and exists, and always with the active UV map."""
    active = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    result.uv_active = active.name if active else ""
    color = mesh.color_attributes.render_color_index
    result.color_active = mesh.color_attributes[color].name if color >= 0 else ""
    names = wanted | {result.uv_active}
    if ACTIVE_COLOR in wanted:
        names.add(result.color_active)
    for name in sorted(names - {"", ACTIVE_COLOR}):
        layer = mesh.attributes.get(name)
        if layer is not None:
            attribute = _attribute(layer, corners, faces, result.name, context)
            if attribute is not None:
                result.attributes[name] = attribute
        elif name == TANGENT or name.endswith(f".{TANGENT}"):
            _add_tangents(result, mesh, name, corners)
        elif name == GENERATED and undeformed is not None:
            _add_generated(result, undeformed)
        elif (derived := derived_attribute(name, result, mesh)) is not None:
            result.attributes[name] = derived


def _attribute(layer: Any, corners: I32, faces: I32, mesh_name: str, context: ExportContext) -> Attribute | None:
    """One attribute with the elements of our domains: corners and faces are expanded to triangles."""
    kind = TYPES.get(layer.data_type)
    if kind is None or layer.domain not in ("POINT", "CORNER", "FACE"):
        context.warn(
            f'Mesh "{mesh_name}": attribute "{layer.name}" ({layer.data_type} per {layer.domain.lower()}) cannot be read'
            " by shaders and gives 0. Convert it with Attribute > Convert."
        )
        return None
    value, channels, dtype = kind
    data = read(layer.data, value, channels * len(layer.data), dtype).reshape(-1, channels)
    if layer.domain == "CORNER":
        data = data[corners]
    elif layer.domain == "FACE":
        data = data[faces]
    return Attribute(np.ascontiguousarray(data, dtype=np.float32), layer.domain)


def _add_tangents(result: Mesh, mesh: Any, name: str, corners: I32) -> None:
    map_name = result.uv_active if name == TANGENT else name.removesuffix(f".{TANGENT}")
    layer = mesh.attributes.get(map_name) if map_name else None
    if layer is not None and layer.data_type == "FLOAT2" and layer.domain == "CORNER":
        uv: F32 = read(layer.data, "vector", 2 * len(layer.data), np.float32).reshape(-1, 2)[corners]
        result.attributes[name] = Attribute(corner_tangents(result, uv), "CORNER")


def _add_generated(result: Mesh, undeformed: Any) -> None:
    """Generated coordinates stick to the undeformed mesh: they move with a limb that an armature bends."""
    if len(undeformed.vertices) != len(result.positions):
        return
    layer = undeformed.attributes["position"].data
    rest = read(layer, "vector", 3 * len(undeformed.vertices), np.float32).reshape(-1, 3)
    if np.array_equal(rest, result.positions):
        return
    size = np.array(result.texture_size, dtype=np.float32)
    scaled = (rest - np.array(result.texture_location, dtype=np.float32)) / np.where(size != 0.0, size, 1.0)
    result.attributes[GENERATED] = Attribute(np.ascontiguousarray(scaled * 0.5 + 0.5, dtype=np.float32), "POINT")

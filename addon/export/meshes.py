"""Meshes: Blender's evaluated arrays, copied at memory speed, as triangles in object space."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from luch.scene import F32, Mesh
from numpy.typing import NDArray

from .attributes import add_attributes, read
from .context import ExportContext

I32 = NDArray[np.int32]


def export_mesh(mesh: Any, wanted: set[str], undeformed: Any, context: ExportContext) -> Mesh | None:
    """Triangles of an evaluated mesh; None if it has none.

    wanted: what its materials read (see attributes.wishes). undeformed: the mesh before modifiers, None if unknown.
    """
    count = len(mesh.loop_triangles)
    if count == 0:
        return None
    corners = triangle_corners(mesh, count)
    corner_vertices = read(mesh.attributes[".corner_vert"].data, "value", len(mesh.loops), np.int32)
    positions = read(mesh.attributes["position"].data, "vector", 3 * len(mesh.vertices), np.float32).reshape(-1, 3)
    faces = read(mesh.loop_triangle_polygons, "value", count, np.int32)
    triangles = corner_vertices[corners].reshape(-1, 3)
    result = Mesh(
        name=mesh.name,
        positions=positions,
        triangles=triangles.view(np.uint32),
        material_slots=_material_slots(mesh, faces),
        texture_location=tuple(mesh.texspace_location),
        texture_size=tuple(mesh.texspace_size),
    )
    add_normals(result, mesh, corners, faces)
    add_attributes(result, mesh, wanted, corners, faces, undeformed, context)
    return _without_invalid(result, context)


def triangle_corners(mesh: Any, count: int) -> I32:
    """The three corners of every triangle, int32 (3T,).

    Blender keeps them as one array, and the address of the first triangle is that array's; reading it costs 1 ms a
    million where foreach_get costs 125. The address is no promise of Blender's, so the first, middle and last triangle
    must agree with what the API says, else the slow way is taken.
    """
    address = mesh.loop_triangles[0].as_pointer()
    last = mesh.loop_triangles[count - 1].as_pointer()
    if last - address == (count - 1) * 12:
        shared = np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_int32)), (count, 3))
        probes = (0, count // 2, count - 1)
        if all(tuple(shared[index]) == tuple(mesh.loop_triangles[index].loops) for index in probes):
            return shared.reshape(-1).copy()
    return read(mesh.loop_triangles, "loops", 3 * count, np.int32)


def _material_slots(mesh: Any, faces: I32) -> NDArray[np.uint16]:
    layer = mesh.attributes.get("material_index")
    if layer is None or layer.domain != "FACE" or layer.data_type != "INT":
        return np.zeros(len(faces), dtype=np.uint16)
    slots = read(layer.data, "value", len(mesh.polygons), np.int32)
    limited: NDArray[np.uint16] = np.clip(slots, 0, 0xFFFF).astype(np.uint16)
    return limited[faces]


def add_normals(result: Mesh, mesh: Any, corners: I32, faces: I32) -> None:
    """Unit normals where Blender shades smooth; flat faces keep their triangles' own normals."""
    domain = mesh.normals_domain
    if domain == "POINT":
        result.normals = read(mesh.vertex_normals, "vector", 3 * len(mesh.vertices), np.float32).reshape(-1, 3)
        result.normals_domain = "POINT"
    elif domain == "CORNER":
        normals = read(mesh.corner_normals, "vector", 3 * len(mesh.loops), np.float32).reshape(-1, 3)[corners]
        sharp = mesh.attributes.get("sharp_face")
        if sharp is not None and sharp.domain == "FACE":
            flat = read(sharp.data, "value", len(mesh.polygons), np.bool_)[faces]
            normals.reshape(-1, 3, 3)[flat] = _flat_normals(result, flat)[:, None]
        result.normals = normals
        result.normals_domain = "CORNER"


def _flat_normals(result: Mesh, chosen: NDArray[np.bool_]) -> F32:
    a, b, c = (result.positions[result.triangles[chosen, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(lengths > 0.0, lengths, 1.0), dtype=np.float32)


def _without_invalid(result: Mesh, context: ExportContext) -> Mesh | None:
    """The mesh without triangles that touch a vertex that is not finite, and a word about them."""
    finite = np.isfinite(result.positions).all(axis=1)
    if finite.all():
        return result
    vertex = int(np.argmin(finite))
    keep = finite[result.triangles].all(axis=1)
    context.warn(
        f'Mesh "{result.name}": vertex {vertex} is not finite; {int((~keep).sum())} triangles that use such vertices'
        " are left out. Remove them with Mesh > Clean Up."
    )
    result.positions[~finite] = 0.0
    result.triangles = result.triangles[keep]
    result.material_slots = result.material_slots[keep]
    corner_keep = np.repeat(keep, 3)
    if result.normals is not None and result.normals_domain == "CORNER":
        result.normals = result.normals[corner_keep]
    for attribute in result.attributes.values():
        if attribute.domain == "CORNER":
            attribute.data = attribute.data[corner_keep]
        elif attribute.domain == "FACE":
            attribute.data = attribute.data[keep]
    return result if len(result.triangles) else None

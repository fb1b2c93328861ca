"""A mesh's shape at another time of the frame: the same triangles, elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from luch.scene import F32, Mesh

from .attributes import read
from .meshes import I32, add_normals, triangle_corners


@dataclass
class MeshTopology:
    """Which corners make a mesh's triangles. Blender cuts a face into triangles by its shape, so they are kept."""

    corner_vertices: I32  # (L,) vertex of each corner of a face
    triangles: I32  # (3T,) corner of each corner of a triangle
    faces: I32  # (T,) face of each triangle

    @staticmethod
    def of(mesh: Any) -> MeshTopology:
        """Of an evaluated mesh."""
        count = len(mesh.loop_triangles)
        return MeshTopology(
            _corner_vertices(mesh),
            triangle_corners(mesh, count),
            read(mesh.loop_triangle_polygons, "value", count, np.int32),
        )


def _corner_vertices(mesh: Any) -> I32:
    return read(mesh.attributes[".corner_vert"].data, "value", len(mesh.loops), np.int32)


def export_shape(mesh: Any, topology: MeshTopology, middle: Mesh) -> tuple[F32, F32 | None] | None:
    """Positions and normals of an evaluated mesh, as `middle` has them; None if it is not the same mesh any more."""
    if len(mesh.vertices) != len(middle.positions) or len(mesh.loops) != len(topology.corner_vertices):
        return None
    if not np.array_equal(_corner_vertices(mesh), topology.corner_vertices):
        return None
    positions = read(mesh.attributes["position"].data, "vector", 3 * len(mesh.vertices), np.float32).reshape(-1, 3)
    shape = Mesh(mesh.name, positions, middle.triangles, middle.material_slots)
    add_normals(shape, mesh, topology.triangles, topology.faces)
    return (positions, shape.normals) if shape.normals_domain == middle.normals_domain else None


def read_velocity(mesh: Any) -> F32 | None:
    """How far each vertex moves in a frame, (V, 3) object space: the attribute that simulations and caches leave."""
    velocity = mesh.attributes.get("velocity")
    if velocity is None or velocity.domain != "POINT" or velocity.data_type != "FLOAT_VECTOR":
        return None
    return read(velocity.data, "vector", 3 * len(mesh.vertices), np.float32).reshape(-1, 3)

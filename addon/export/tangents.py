"""Tangents for normal maps, as every baker makes them: MikkTSpace (Morten Mikkelsen 2008) on triangles."""

from __future__ import annotations

import numpy as np
from luch.scene import F32, Mesh
from numpy.typing import NDArray


def corner_tangents(mesh: Mesh, uv: F32) -> F32:
    """Tangent and sign of the bitangent of each corner, float32 (3T, 4). uv: (3T, 2), per corner.

    The tangents of a vertex's triangles are averaged, weighted by their angles there, where position, normal, UV and
    the UV's handedness agree. Bitangent = sign * cross(normal, tangent). Zero where the UV map has no area.
    """
    positions = mesh.positions[mesh.triangles.reshape(-1)]
    normals = _corner_normals(mesh, positions)
    face, sign = _face_tangents(positions.reshape(-1, 3, 3), uv.reshape(-1, 3, 2))
    corner = _projected(np.repeat(face, 3, axis=0), normals)
    corner *= _corner_angles(positions.reshape(-1, 3, 3), normals.reshape(-1, 3, 3)).reshape(-1, 1)
    corner_sign = np.repeat(sign, 3)
    group = _groups(positions, normals, uv, corner_sign)
    total = np.stack([np.bincount(group, weights=corner[:, axis]) for axis in range(3)], axis=1)
    result = np.empty((len(corner), 4), dtype=np.float32)
    result[:, :3] = _normalized(total)[group]
    result[:, 3] = corner_sign
    return result


def _corner_normals(mesh: Mesh, positions: F32) -> F32:
    if mesh.normals is None:
        triangles = positions.reshape(-1, 3, 3)
        flat = _normalized(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
        return np.repeat(flat, 3, axis=0)
    return mesh.normals[mesh.triangles.reshape(-1)] if mesh.normals_domain == "POINT" else mesh.normals


def _face_tangents(positions: F32, uv: F32) -> tuple[F32, F32]:
    """Unit direction in which u grows on each triangle, (T, 3), and the handedness of its UV, (T,) of +1 or -1."""
    edge1, edge2 = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    sign = np.where(area > 0.0, np.float32(1.0), np.float32(-1.0))
    direction = d2[:, 1:] * edge1 - d1[:, 1:] * edge2
    tangent = _normalized(direction) * sign[:, None]
    tangent[area == 0.0] = 0.0
    return tangent, sign


def _corner_angles(positions: F32, normals: F32) -> F32:
    """Angle of each triangle at each corner, measured in the plane of the corner's normal, (T, 3) radians."""
    angles = np.empty(positions.shape[:2], dtype=np.float32)
    for corner in range(3):
        here, normal = positions[:, corner], normals[:, corner]
        to_next = _projected(positions[:, (corner + 1) % 3] - here, normal)
        to_last = _projected(positions[:, (corner + 2) % 3] - here, normal)
        angles[:, corner] = np.arccos(np.clip(np.einsum("ij,ij->i", to_next, to_last), -1.0, 1.0))
    return angles


def _groups(positions: F32, normals: F32, uv: F32, sign: F32) -> NDArray[np.int64]:
    """A number per corner, equal where all of these are equal, bit for bit."""
    key = np.concatenate([positions, normals, uv, sign[:, None]], axis=1) + np.float32(0.0)  # -0 becomes 0
    bits = np.ascontiguousarray(key).view(np.uint32).astype(np.uint64)
    mixed = np.zeros(len(bits), dtype=np.uint64)
    for column in range(bits.shape[1]):  # 64 bits: a false match among millions has a chance below 1e-6
        mixed = (mixed ^ bits[:, column]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(32)
    return np.unique(mixed, return_inverse=True)[1]


def _projected(vectors: F32, normals: F32) -> F32:
    """Unit vectors in the planes of the normals."""
    return _normalized(vectors - normals * np.einsum("ij,ij->i", vectors, normals)[:, None])


def _normalized(vectors: NDArray[np.floating]) -> F32:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0), dtype=np.float32)

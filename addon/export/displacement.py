"""True displacement: a material's Displacement moves the mesh's vertices before anything is traced.

As Cycles does it: every vertex is shaded once, as a corner of the first triangle that has it, in the first object that
shows the mesh; then the normals of smooth faces are made anew. Detail is that of the mesh: subdivide it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from luch import core
from luch.bounds import FLAT_CORNER
from luch.scene import F32, Attribute, Image, Mesh, Program
from numpy.typing import NDArray

from .attributes import GENERATED, TANGENT

# Normals before displacement, object space: what bump is added to where a material asks for both.
UNDISPLACED_NORMAL = "undisplaced normal"

Bools = NDArray[np.bool_]


@dataclass
class Displaced:
    """The object that a mesh is displaced in."""

    to_world: NDArray[np.float64]  # (3, 4)
    location: tuple[float, float, float]
    color: tuple[float, ...]
    index: float
    random: float


def displace(
    mesh: Mesh, programs: Sequence[Program | None], owner: Displaced, images: Sequence[Image], wanted: set[str]
) -> Mesh:
    """The mesh with its vertices moved. programs: of each material slot, the displacement in world space as emission;
    None: that material moves nothing. wanted: what its materials read. The mesh itself if nothing moves."""
    used, first = np.unique(mesh.triangles.reshape(-1), return_index=True)
    triangle, corner = first // 3, first % 3
    normals = _corner_normals(mesh)
    slots = np.minimum(mesh.material_slots[triangle], len(programs) - 1)
    moved = np.zeros_like(mesh.positions)
    for slot, program in enumerate(programs):
        chosen = np.flatnonzero(slots == slot)
        if program is not None and len(chosen):
            at = normals[triangle[chosen], corner[chosen]]
            moved[used[chosen]] = _offsets(
                mesh, program, used[chosen], triangle[chosen], corner[chosen], at, owner, images
            )
    moved[~np.isfinite(moved).all(axis=1)] = 0.0
    if not moved.any():
        return mesh
    return _rebuilt(mesh, mesh.positions + moved, normals, wanted)


def _offsets(
    mesh: Mesh,
    program: Program,
    vertices: NDArray[np.integer[Any]],
    triangles: NDArray[np.integer[Any]],
    corners: NDArray[np.integer[Any]],
    normals: F32,
    owner: Displaced,
    images: Sequence[Image],
) -> F32:
    """How far vertices move, object space."""
    linear = owner.to_world[:, :3]
    inverse = np.linalg.pinv(linear)
    world = mesh.positions[vertices] @ linear.T + owner.to_world[:, 3]
    facing = _unit(normals @ inverse)
    points = {
        "position": world.astype(np.float32),
        "normal": facing.astype(np.float32),
        "geometric_normal": facing.astype(np.float32),
        "incoming": facing.astype(np.float32),
        "uv": np.stack([corners == 1, corners == 2], axis=1).astype(np.float32),
        "prim": triangles.astype(np.uint32),
    }
    to_object = np.concatenate([inverse, -(inverse @ owner.to_world[:, 3])[:, None]], axis=1)
    scene = {
        **_read_mesh(mesh, program),
        "to_world": owner.to_world.astype(np.float32),
        "to_object": to_object.astype(np.float32),
        "object_location": np.array(owner.location, np.float32),
        "object_color": np.array(owner.color, np.float32),
        "object_index": owner.index,
        "object_random": owner.random,
        "images": [(images[k].pixels, images[k].colorspace == "SRGB", _ALPHA[images[k].alpha]) for k in program.images],
    }
    code = (program.code, program.constants, program.register_count, program.tables)
    told = core.shade.run_program(*code, len(vertices), points, scene)["emission"]
    result: F32 = (np.asarray(told, np.float64) @ inverse.T).astype(np.float32)
    return result


_ALPHA = {"STRAIGHT": 0, "PREMULTIPLIED": 1, "CHANNEL_PACKED": 2, "NONE": 3}


def _read_mesh(mesh: Mesh, program: Program) -> dict[str, Any]:
    """Mesh and attributes as the interpreter wants them: those that the program names, then the defaults."""
    names = [*program.attributes, mesh.uv_active, mesh.color_active, GENERATED, TANGENT]
    missing = (np.zeros((1, 4), np.float32), "NONE")
    columns = [
        (found.data, found.domain) if (found := mesh.attributes.get(name)) is not None else missing for name in names
    ]
    defaults = ("uv_attribute", "color_attribute", "generated_attribute", "tangent_attribute")
    first = len(program.attributes)
    arrays: dict[str, Any] = {
        "positions": mesh.positions,
        "triangles": mesh.triangles,
        "texture_location": mesh.texture_location,
        "texture_size": mesh.texture_size,
        "attributes": columns,
    }
    if mesh.normals is not None:
        arrays["normals"] = mesh.normals
    there = {name: first + k for k, name in enumerate(defaults) if names[first + k] and columns[first + k][1] != "NONE"}
    return {"mesh": arrays, **there}


def _corner_normals(mesh: Mesh) -> F32:
    """Unit normals of every corner, (T, 3, 3)."""
    if mesh.normals is None:
        return np.repeat(_face_normals(mesh.positions, mesh.triangles)[:, None], 3, axis=1)
    if mesh.normals_domain == "POINT":
        of_corners: F32 = mesh.normals[mesh.triangles]
        return of_corners
    return mesh.normals.reshape(-1, 3, 3)


def _rebuilt(mesh: Mesh, positions: F32, normals: F32, wanted: set[str]) -> Mesh:
    """The mesh of the moved vertices; what was smooth is smooth again."""
    attributes = dict(mesh.attributes)
    if UNDISPLACED_NORMAL in wanted:
        attributes[UNDISPLACED_NORMAL] = Attribute(np.ascontiguousarray(normals.reshape(-1, 3)), "CORNER")
    if GENERATED in wanted and GENERATED not in attributes:
        size = np.array(mesh.texture_size, np.float32)
        scaled = (mesh.positions - np.array(mesh.texture_location, np.float32)) / np.where(size != 0.0, size, 1.0)
        attributes[GENERATED] = Attribute((scaled * np.float32(0.5) + np.float32(0.5)).astype(np.float32), "POINT")
    result = replace(mesh, positions=positions.astype(np.float32), attributes=attributes, displaced=True)
    if mesh.normals is None:
        return result
    faces = _face_normals(result.positions, mesh.triangles)
    sums = np.zeros(mesh.positions.shape, np.float64)
    for k in range(3):  # each face counts alike, as in Cycles
        np.add.at(sums, mesh.triangles[:, k], faces)
    smooth = _unit(sums).astype(np.float32)
    if mesh.normals_domain == "POINT":
        result.normals = smooth
        return result
    before = _face_normals(mesh.positions, mesh.triangles)
    flat: Bools = (np.abs(normals - before[:, None]).max(axis=2) < FLAT_CORNER).all(axis=1)
    corners = smooth[mesh.triangles]
    corners[flat] = faces[flat, None]
    result.normals = np.ascontiguousarray(corners.reshape(-1, 3))
    return result


def _face_normals(positions: F32, triangles: NDArray[np.uint32]) -> F32:
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    return _unit(np.cross(b - a, c - a)).astype(np.float32)


def _unit(vectors: NDArray[Any]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0), np.float64)

"""Values that Blender does not store on meshes and shaders may ask for: islands, pointiness, properties."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from luch import core
from luch.scene import F32, Attribute, Mesh
from numpy.typing import NDArray

from .hashes import random_of

ISLAND = "island_random"
POINTINESS = "pointiness"


def derived_attribute(name: str, result: Mesh, mesh: Any) -> Attribute | None:
    """The attribute that Geometry nodes read under this name; None for any other name."""
    if name == ISLAND:
        edges = _edges(mesh)
        return Attribute(core.shade.island_random(len(result.positions), edges, result.triangles)[:, None], "FACE")
    if name == POINTINESS:
        return Attribute(pointiness(result.positions, _normals(mesh), _edges(mesh))[:, None], "POINT")
    return None


def pointiness(positions: F32, normals: F32, edges: NDArray[np.int32]) -> F32:
    """How sharply the surface bends at each vertex, float32 (V,): 1/2 is flat, 1 a spike, 0 a dent.

    The angle between the normal and the mean direction of the edges, in half turns, averaged once over
    neighbours. Vertices at one place count as one. positions, normals: (V, 3); edges: (E, 2).
    """
    _, first, place = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    count = len(first)
    place = place.reshape(-1)
    normal = np.stack([np.bincount(place, normals[:, k], count) for k in range(3)], 1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    ends = np.unique(np.sort(place[edges], axis=1), axis=0)
    a, b = ends[ends[:, 0] != ends[:, 1]].T
    step = positions[first[b]].astype(np.float64) - positions[first[a]]
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-30)
    degree = np.bincount(a, minlength=count) + np.bincount(b, minlength=count)
    mean = np.stack([np.bincount(a, step[:, k], count) - np.bincount(b, step[:, k], count) for k in range(3)], 1)
    cosine = (normal * mean).sum(1) / np.maximum(degree, 1)
    sharp = np.where(degree > 0, np.arccos(np.clip(cosine, -1.0, 1.0)) / np.pi, 0.0)
    blurred = sharp + np.bincount(a, sharp[b], count) + np.bincount(b, sharp[a], count)
    result: F32 = (blurred / (degree + 1)).astype(np.float32)[place]
    return result


def property_color(owners: Iterable[Any], path: str) -> tuple[float, float, float, float] | None:
    """A property of the first owner that has it, as a colour; custom properties win. None: nobody has it."""
    for owner in owners:
        for spelled in (f'["{path}"]', path):
            try:
                found = owner.path_resolve(spelled)
            except (AttributeError, ValueError, TypeError):
                continue
            if isinstance(found, int | float):
                return float(found), float(found), float(found), 1.0
            numbers = [float(number) for number in found] if hasattr(found, "__len__") and len(found) in (3, 4) else []
            if numbers:
                red, green, blue, alpha = (*numbers, 1.0)[:4]
                return red, green, blue, alpha
    return None


def object_attributes(wanted: Iterable[str], subject: Any, parent: Any) -> dict[str, tuple[float, float, float, float]]:
    """What Attribute nodes read of an object ("object:NAME") or its instancer ("instancer:NAME"); of an object that no
    particle shows, what Particle Info reads ("particle:NAME")."""
    result = {}
    for wish in wanted:
        kind, _, path = wish.partition(":")
        own = (subject, subject.data)
        owners = {"object": own, "instancer": (parent, parent.data, *own), "particle": ()}.get(kind)
        if owners is not None and path:
            result[wish] = property_color(owners, path) or (0.0, 0.0, 0.0, 0.0)
        if wish == "particle:Random":  # what shows no particle counts as the first
            result[wish] = (random_of(0),) * 4
    return result


def _edges(mesh: Any) -> NDArray[np.int32]:
    edges = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    return edges.reshape(-1, 2)


def _normals(mesh: Any) -> F32:
    normals = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertex_normals.foreach_get("vector", normals)
    return normals.reshape(-1, 3)

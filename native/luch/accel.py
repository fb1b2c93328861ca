"""Bare rays through triangles: the acceleration structures over arrays.

A ray is a row ``ox oy oz tmin dx dy dz tmax``; its hits lie in (max(tmin, 0), tmax]. Directions need not be unit;
t is in their units. Whatever the structure, the hit is the smallest t and, on equal t, the smaller triangle index.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from luch._native import core

Float32s = npt.NDArray[np.float32]
Int32s = npt.NDArray[np.int32]
KINDS = ("BVH", "BRUTE_FORCE")
_ALL_KINDS = np.zeros(0, np.uint32)  # no mask: every ray sees everything


class Accel:
    """Triangles that rays can be traced through.

    positions: (V, 3) float32. triangles: (T, 3) uint32 vertex indices. kind: "BVH", the eight-wide tree, or
    "BRUTE_FORCE", every triangle in turn: the oracle, and for tiny meshes. threads: 0 is all processors.
    may_be_transparent: (T,) bool, for `blocked`. Triangles with a vertex that is not finite, or with an index
    outside the mesh, are dropped and counted in `stats`. Raises ValueError on wrong shapes or types.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        triangles: npt.ArrayLike,
        kind: Literal["BVH", "BRUTE_FORCE"] = "BVH",
        threads: int = 0,
        may_be_transparent: npt.ArrayLike | None = None,
    ) -> None:
        if kind not in KINDS:
            raise ValueError(f"kind is {kind!r}; it must be one of {', '.join(KINDS)}.")
        if not 0 <= threads <= 1024:
            raise ValueError(f"threads is {threads}; it must lie in 0 (all processors) to 1024.")
        points = _rows(positions, 3, np.float32, "positions")
        corners = _rows(triangles, 3, np.uint32, "triangles")
        flags = np.zeros(0, np.uint8)
        if may_be_transparent is not None:
            flags = np.ascontiguousarray(may_be_transparent, dtype=bool).astype(np.uint8)
            if flags.shape != (len(corners),):
                raise ValueError(f"may_be_transparent has shape {flags.shape}; it must be ({len(corners)},).")
        mesh = np.array([[0, len(points), 0, len(corners)]], np.uint32)
        here = np.eye(3, 4, dtype=np.float32).reshape(1, 12)
        self._core = core.ArrayAccel(
            points, corners, flags, mesh, np.zeros(1, np.uint32), here, here, np.full(1, 63, np.uint32),
            kind == "BRUTE_FORCE", threads, 0)  # fmt: skip

    def closest(self, rays: npt.ArrayLike) -> tuple[Float32s, Int32s, Float32s, Float32s]:
        """Closest hit of each ray. rays: (N, 8) float32.

        Returns t (inf on a miss), triangle index (-1 on a miss), and the barycentrics u, v:
        point = (1 - u - v) p0 + u p1 + v p2; each (N,). A ray that is not finite or has no direction misses.
        """
        t, prim, u, v, _ = self._core.closest(_rows(rays, 8, np.float32, "rays"), _ALL_KINDS)
        return t, prim, u, v

    def blocked(self, rays: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """What lies in each ray's interval: 0 nothing, 1 an opaque triangle, 2 only ones that may be transparent."""
        result: npt.NDArray[np.uint8] = self._core.any(_rows(rays, 8, np.float32, "rays"), _ALL_KINDS)
        return result

    def any(self, rays: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether each ray hits anything. rays: (N, 8) float32; returns (N,) bool."""
        return np.asarray(self.blocked(rays) != 0, np.bool_)

    @property
    def stats(self) -> dict[str, float]:
        """Counts of the structure: triangles, nodes, leaf_blocks, bytes, dropped_triangles, build_seconds."""
        result: dict[str, float] = self._core.stats()
        return result


def _rows(array: npt.ArrayLike, width: int, dtype: type[np.generic], name: str) -> npt.NDArray[np.generic]:
    given = np.asarray(array)
    if given.ndim != 2 or given.shape[1] != width:
        raise ValueError(f"{name} has shape {given.shape}; it must be (N, {width}).")
    kinds = "f" if dtype is np.float32 else "iu"
    if given.dtype.kind not in kinds and not (dtype is np.float32 and given.dtype.kind in "iu"):
        raise ValueError(f"{name} holds {given.dtype}; it must hold {np.dtype(dtype)}.")
    if dtype is np.uint32 and given.size and (given.min() < 0 or given.max() > 0xFFFFFFFF):
        raise ValueError(f"{name} has an index outside 0 to 4294967295.")
    return np.ascontiguousarray(given, dtype=dtype)

"""Bare rays through triangles: the acceleration structures over arrays.

A ray is a row ``ox oy oz tmin dx dy dz tmax``; its hits lie in (max(tmin, 0), tmax]. Directions need not be unit;
t is in their units. Whatever the structure, the hit is the smallest t and, on equal t, the smaller triangle index.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from luch._native import core
from luch.cuda.device import is_device_array

Float32s = npt.NDArray[np.float32]
Int32s = npt.NDArray[np.int32]
Kind = Literal[
    "BVH", "BVH2", "BVH2_STACKLESS", "CWBVH", "KD_TREE", "HIERARCHICAL_GRID", "GRID", "BRUTE_FORCE",
]  # fmt: skip
Precision = Literal["FAST", "WATERTIGHT", "DOUBLE"]
Quality = Literal["FAST", "NORMAL", "HIGH"]
Device = Literal["CPU", "CUDA"]
KINDS: tuple[Kind, ...] = get_args(Kind)
PRECISIONS: tuple[Precision, ...] = get_args(Precision)
QUALITIES: tuple[Quality, ...] = get_args(Quality)
DEVICES: tuple[Device, ...] = get_args(Device)
# StructureKind of cpu/accel/structure.h
STRUCTURES = ("BRUTE_FORCE", "GRID", "HIERARCHICAL_GRID", "BVH2", "BVH2_STACKLESS", "KD_TREE", "CWBVH")
_ALL_KINDS = np.zeros(0, np.uint32)  # no mask: every ray sees everything


class Accel:
    """Triangles and spheres that rays can be traced through.

    positions: (V, 3) float32. triangles: (T, 3) uint32 vertex indices. spheres: (S, 4) float32, centre and radius
    (below zero: only the outside of such a ball is hit); sphere k is primitive T + k. kind: the structure; "BVH" is the eight-wide tree, "BRUTE_FORCE" every primitive in
    turn: the oracle, and for tiny meshes. precision: "FAST" (single precision), "WATERTIGHT" (no ray slips between
    two triangles that share an edge) or "DOUBLE". quality of the build: "FAST", "NORMAL" or "HIGH".
    may_be_transparent: (T + S,) bool, for `blocked`. threads: 0 is all processors. device: "CUDA" takes rays from
    NumPy or from the GPU (CuPy) and answers in kind; "BVH" is there the compressed eight-wide tree ("CWBVH"); with
    quality "FAST" that one is built on the GPU, all else on the CPU and uploaded. Primitives with a number that is not finite, with an index outside the
    mesh or of no area or no radius are dropped and counted in `stats`. Raises ValueError on wrong shapes or types,
    luch.cuda.DeviceError where CUDA cannot be used.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        triangles: npt.ArrayLike,
        kind: Kind = "BVH",
        precision: Precision = "WATERTIGHT",
        spheres: npt.ArrayLike | None = None,
        may_be_transparent: npt.ArrayLike | None = None,
        quality: Quality = "NORMAL",
        threads: int = 0,
        device: Device = "CPU",
    ) -> None:
        _one_of(kind, KINDS, "kind")
        _one_of(precision, PRECISIONS, "precision")
        _one_of(quality, QUALITIES, "quality")
        _one_of(device, DEVICES, "device")
        if not 0 <= threads <= 1024:
            raise ValueError(f"threads is {threads}; it must lie in 0 (all processors) to 1024.")
        if device == "CUDA":
            positions, triangles, spheres, may_be_transparent = map(
                _on_host, (positions, triangles, spheres, may_be_transparent)
            )
        points = _rows(positions, 3, np.float32, "positions")
        corners = _rows(triangles, 3, np.uint32, "triangles")
        balls = _rows(np.zeros((0, 4)) if spheres is None else spheres, 4, np.float32, "spheres")
        count = len(corners) + len(balls)
        if count >= 2**31 - 1:
            raise ValueError(f"{count} primitives; one structure holds fewer than 2147483647.")
        flags = np.zeros(0, np.uint8)
        if may_be_transparent is not None:
            flags = np.ascontiguousarray(may_be_transparent, dtype=bool).astype(np.uint8)
            if flags.shape != (count,):
                raise ValueError(f"may_be_transparent has shape {flags.shape}; it must be ({count},).")
        self.kind, self.precision, self.device = kind, precision, device
        self._precision: Any = PRECISIONS.index(precision)
        self._wide: Any = None
        self._structure: Any = None
        if device == "CUDA":
            from luch.cuda.structures import DeviceStructure

            kind = "CWBVH" if kind == "BVH" else kind
            number, detail = STRUCTURES.index(kind), QUALITIES.index(quality)
            if kind == "CWBVH" and quality == "FAST" and not len(balls):
                self._structure = DeviceStructure.built(points, corners, flags)
            if self._structure is None:
                host = core.ArrayStructure(points, corners, balls, flags, number, detail, threads)
                self._structure = DeviceStructure.uploaded(host, kind, points, corners, balls, flags)
            self._precision = precision
        elif kind == "BVH":
            mesh = np.array([[0, len(points), 0, len(corners), 0, len(balls)]], np.uint32)
            here = np.eye(3, 4, dtype=np.float32).reshape(1, 12)
            self._wide = core.ArrayAccel(
                points, corners, flags, mesh, np.zeros(1, np.uint32), here, here, np.full(1, 63, np.uint32),
                -1, QUALITIES.index(quality), self._precision, threads, 0, balls)  # fmt: skip
        else:
            number, detail = STRUCTURES.index(kind), QUALITIES.index(quality)
            self._structure = core.ArrayStructure(points, corners, balls, flags, number, detail, threads)

    def closest(self, rays: npt.ArrayLike) -> tuple[Float32s, Int32s, Float32s, Float32s]:
        """Closest hit of each ray. rays: (N, 8) float32.

        Returns t (inf on a miss), primitive index (-1 on a miss), and the barycentrics u, v:
        point = (1 - u - v) p0 + u p1 + v p2; each (N,). Spheres have u = v = 0. A ray that is not finite or has no
        direction misses.
        """
        given = self._rays(rays)
        if self._wide is None:
            t, prim, u, v, _ = self._structure.closest(given, self._precision, False)
            return t, prim, u, v
        t, prim, u, v, _ = self._wide.closest(given, _ALL_KINDS)
        return t, prim, u, v

    def blocked(self, rays: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """What lies in each ray's interval: 0 nothing, 1 something opaque, 2 only what may be transparent."""
        given = self._rays(rays)
        result: npt.NDArray[np.uint8]
        if self._wide is None:
            result = self._structure.any(given, self._precision, False)[0]
        else:
            result = self._wide.any(given, _ALL_KINDS)
        return result

    def any(self, rays: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether each ray hits anything. rays: (N, 8) float32; returns (N,) bool."""
        result: npt.NDArray[np.bool_] = self.blocked(rays) != 0
        return result

    def count(self, rays: npt.ArrayLike, any_hit: bool = False) -> dict[str, int]:
        """The work of tracing these rays, all together: nodes, boxes (or planes), primitives tested, bytes read.

        Traced by code compiled with counters, one ray after the other; `closest` and `any` have none. The eight-wide
        tree tests the eight boxes of a node at once, and the triangles of a block (one to four) or its spheres (one to
        eight): each of them is counted.
        """
        given = self._rays(rays)
        result: dict[str, int]
        if self._wide is not None:
            result = self._wide.count(given, any_hit)
        else:
            trace = self._structure.any if any_hit else self._structure.closest
            result = trace(given, self._precision, True)[-1]
        return result

    @property
    def on_device(self) -> Any:
        """The luch.cuda.structures.DeviceStructure of device="CUDA"; None on the CPU."""
        return self._structure if self.device == "CUDA" else None

    @property
    def device_source_bytes(self) -> int:
        """Bytes of triangles and spheres on the device, beside the structure's own."""
        return 0 if self.on_device is None else int(self.on_device.source_bytes)

    def _rays(self, rays: npt.ArrayLike) -> Any:
        if self.device == "CUDA" and is_device_array(rays):
            return _rows_on_device(rays)
        return _rows(rays, 8, np.float32, "rays")

    @property
    def stats(self) -> dict[str, float]:
        """Counts of the structure: its primitives (triangles, spheres), nodes, bytes, and how many were dropped."""
        return dict((self._wide or self._structure).stats())


def _one_of(given: str, names: tuple[str, ...], what: str) -> None:
    if given not in names:
        raise ValueError(f"{what} is {given!r}; it must be one of {', '.join(names)}.")


def _on_host(array: Any) -> Any:
    if not is_device_array(array):
        return array
    from luch.cuda.device import cupy

    return cupy().asnumpy(cupy().asarray(array))


def _rows_on_device(array: Any) -> Any:
    """Rays that lie on the GPU, as the kernels read them."""
    from luch.cuda.device import cupy

    given = cupy().asarray(array)
    if given.ndim != 2 or given.shape[1] != 8:
        raise ValueError(f"rays has shape {given.shape}; it must be (N, 8).")
    if given.dtype.kind not in "fiu":
        raise ValueError(f"rays holds {given.dtype}; it must hold float32.")
    return cupy().ascontiguousarray(given, dtype=np.float32)


def _rows(array: npt.ArrayLike, width: int, dtype: type[np.generic], name: str) -> npt.NDArray[np.generic]:
    if is_device_array(array):
        raise ValueError(f"{name} lies on a GPU; an Accel with device='CUDA' takes such arrays.")
    given = np.asarray(array)
    if given.ndim != 2 or given.shape[1] != width:
        raise ValueError(f"{name} has shape {given.shape}; it must be (N, {width}).")
    kinds = "f" if dtype is np.float32 else "iu"
    if given.dtype.kind not in kinds and not (dtype is np.float32 and given.dtype.kind in "iu"):
        raise ValueError(f"{name} holds {given.dtype}; it must hold {np.dtype(dtype)}.")
    if dtype is np.uint32 and given.size and (given.min() < 0 or given.max() > 0xFFFFFFFF):
        raise ValueError(f"{name} has an index outside 0 to 4294967295.")
    return np.ascontiguousarray(given, dtype=dtype)

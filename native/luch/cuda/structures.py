"""The structures of the race on a GPU: built on the CPU, uploaded, walked by the same functions."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from luch.cuda.builder import build_cwbvh
from luch.cuda.compiler import load
from luch.cuda.device import Kernel, cupy, is_device_array

BLOCK = 128  # RAY_BLOCK of rays/structure.cuh
OWN_PRIMITIVES = ("CWBVH",)  # their leaves hold the primitives
PERSISTENT = {("CWBVH", "closest"), ("CWBVH", "any")}  # as many blocks as fit at once, which fetch their rays
COUNTERS = ("nodes", "boxes", "primitives", "bytes")


class DeviceStructure:
    """A structure's view and arrays on the current device. kind: a module of kernels.json."""

    def __init__(self, kind: str, view: bytes, arrays: list[Any], sources: list[Any], stats: dict[str, float]) -> None:
        """view: the struct's bytes, pointing at arrays. sources: corners (T, 3, 3), spheres (S, 4), flags."""
        self.kind = kind
        self._view, self._arrays, self._sources, self._stats = view, arrays, sources, stats
        pointers = [a.data.ptr if a.size else 0 for a in sources]
        self._primitives = struct.pack("<QQQII32x", *pointers, len(sources[0]), len(sources[1]))

    @classmethod
    def uploaded(
        cls, host: Any, kind: str, positions: Any, triangles: Any, spheres: Any, flags: Any
    ) -> DeviceStructure:
        """Built on the CPU: host is core.ArrayStructure of that kind, the rest what it was built from."""
        view, arrays = upload_view(*host.device_arrays())
        if kind in OWN_PRIMITIVES:
            triangles, spheres, flags = triangles[:0], spheres[:0], flags[:0]
        inside = np.minimum(triangles, max(len(positions) - 1, 0))  # those outside were dropped by the builder
        corners = positions[inside] if len(positions) else np.zeros((len(triangles), 3, 3), np.float32)
        sources = [cupy().asarray(np.ascontiguousarray(a)) for a in (corners, spheres, flags)]
        return cls(kind, view, arrays, sources, host.stats() | {"built_on_device": False})

    @classmethod
    def built(cls, positions: Any, triangles: Any, flags: Any) -> DeviceStructure | None:
        """The compressed wide tree of triangles, built on the GPU; None where build_cwbvh leaves it to the CPU."""
        made = build_cwbvh(positions, triangles, flags)
        if made is None:
            return None
        view, arrays, stats = made
        nothing = [cupy().empty((0, 9), np.float32), cupy().empty((0, 4), np.float32), cupy().empty(0, np.uint8)]
        return cls("CWBVH", view, arrays, nothing, stats | {"built_on_device": True})

    def closest(self, rays: Any, precision: str, counted: bool, kernel: str = "closest") -> tuple[Any, ...]:
        """rays: (N, 8) float32, NumPy or CuPy. t, prim, u, v of the same library, and a dictionary of counts."""
        cp, count = cupy(), len(rays)
        t, u, v = (cp.empty(count, np.float32) for _ in range(3))
        prim, counters = cp.empty(count, np.int32), cp.zeros(4, np.uint64)
        arrays = {"t": t, "prim": prim, "u": u, "v": v, "counters": counters}
        self.launch(kernel + "_counted" * counted, precision, cp.asarray(rays), arrays)
        return (*_like(rays, t, prim, u, v), named_counts(counters) if counted else {})

    def any(self, rays: Any, precision: str, counted: bool) -> tuple[Any, ...]:
        """rays: as above. Blocked values, and a dictionary of counts."""
        cp, count = cupy(), len(rays)
        blocked, counters = cp.empty(count, np.uint8), cp.zeros(4, np.uint64)
        arrays = {"blocked": blocked, "counters": counters}
        self.launch("any" + "_counted" * counted, precision, cp.asarray(rays), arrays)
        return (*_like(rays, blocked), named_counts(counters) if counted else {})

    def kernel(self, name: str, precision: str) -> Kernel:
        """One of this structure's kernels, compiled on first use."""
        return load(self.kind, precision).kernel(name)

    def launcher(self, name: str, precision: str, rays: Any) -> Callable[[], None]:
        """Traces device rays again and again into the same arrays: for timing."""
        cp, count = cupy(), len(rays)
        arrays = {key: cp.empty(count, np.float32) for key in ("t", "prim", "u", "v")}
        arrays |= {"blocked": cp.empty(count, np.uint8), "counters": cp.zeros(4, np.uint64)}

        def run() -> None:
            self.launch(name, precision, rays, arrays)

        return run

    def launch(self, name: str, precision: str, rays: Any, arrays: dict[str, Any]) -> None:
        """Traces the rays; nothing is waited for."""
        count, kernel = len(rays), self.kernel(name, precision)
        grid = count if name == "closest_reduced" else -(-count // BLOCK)
        if (self.kind, name) in PERSISTENT:
            arrays = {**arrays, "next": cupy().zeros(1, np.uint32)}
            grid = min(grid, kernel.resident_blocks(BLOCK))
        kernel.launch(grid, BLOCK, [self._view, self._primitives, pack_batch(rays, **arrays)])

    @property
    def source_bytes(self) -> int:
        """Of the triangles and spheres themselves."""
        return sum(array.nbytes for array in self._sources)

    def stats(self) -> dict[str, float]:
        """As the builder counted."""
        return self._stats


def _like(given: Any, *results: Any) -> tuple[Any, ...]:
    """The results where the rays came from."""
    return results if is_device_array(given) else tuple(cupy().asnumpy(result) for result in results)


def upload_view(view: bytes, arrays: list[tuple[str, int, bytes]]) -> tuple[bytes, list[Any]]:
    """The view's bytes with its pointers set to copies of the arrays on the device, and the copies."""
    patched, copies = bytearray(view), []
    for _name, offset, data in arrays:
        copy = cupy().asarray(np.frombuffer(data, np.uint8))
        copies.append(copy)
        struct.pack_into("<Q", patched, offset, copy.data.ptr if copy.size else 0)
    return bytes(patched), copies


def pack_batch(rays: Any, **arrays: Any) -> bytes:
    """RayBatch of rays/batch.cuh."""
    order = ("t", "prim", "u", "v", "blocked", "counters", "next")
    pointers = [arrays[name].data.ptr if name in arrays else 0 for name in order]
    return struct.pack("<8QI4x", rays.data.ptr, *pointers, len(rays))


def named_counts(counters: Any) -> dict[str, int]:
    """Counters as a dictionary."""
    return dict(zip(COUNTERS, (int(x) for x in counters.get()), strict=True))

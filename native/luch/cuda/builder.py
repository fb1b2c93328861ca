"""The compressed wide tree built on the GPU: space-filling curve, clusters merged bottom up, taken together by eight.

Source: Benthin et al. 2024, "H-PLOC"; Ylitie, Karras, Laine 2017 for the nodes. Triangles only. The hits are those of
every other tree; the tree's layout depends on which block came first and may differ from run to run.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from luch.cuda.compiler import load
from luch.cuda.device import cupy

BLOCK = 64  # BUILD_BLOCK of build/task.cuh
FEWEST = 64  # triangles; fewer are built on the CPU
MAX_DEPTH = 96  # CWBVH_MAX_DEPTH of luch/accel/cwbvh.h
NODE_BYTES, LEAF_BYTES = 80, 48
ROOT, WIDE_NODES, LEAVES, ITEMS = 1, 2, 3, 4  # BuildCounter of build/task.cuh
POINTERS = ("corners", "flags", "usable", "refs", "boxes", "keys", "nodes", "sizes", "clusters", "arrived",
            "counters", "items", "next_items", "wide", "leaves")  # fmt: skip


class Build:
    """One build: its arrays on the device by the names of BuildTask, and its kernels."""

    def __init__(self, corners: Any, flags: Any) -> None:
        self.arrays: dict[str, Any] = {"corners": corners}
        if flags.size:
            self.arrays["flags"] = flags
        self.box: tuple[float, ...] = (0.0,) * 6  # of all usable triangles: lo, hi
        self.low: tuple[float, ...] = (0.0,) * 3
        self.scale = 0.0

    def run(self, kernel: str, count: int) -> None:
        """One thread for each of count."""
        pointers = [self.arrays[name].data.ptr if name in self.arrays else 0 for name in POINTERS]
        task = struct.pack("<15Q4fI4x", *pointers, *self.low, self.scale, count)
        load("CWBVH_BUILDER", "WATERTIGHT").kernel(kernel).launch(-(-count // BLOCK), BLOCK, [task])

    def counter(self, index: int) -> int:
        """Waits for the device."""
        return int(self.arrays["counters"].get()[index])


def corners_of(positions: Any, triangles: Any) -> Any:
    """(T, 9) float32 on the device; NaN where an index lies outside."""
    cp = cupy()
    positions, triangles = cp.asarray(positions), cp.asarray(triangles)
    inside = (triangles < len(positions)).all(1)
    corners = positions[triangles * inside[:, None]].reshape(-1, 9)
    corners[~inside] = np.nan
    return cp.ascontiguousarray(corners)


def build_cwbvh(positions: Any, triangles: Any, flags: Any) -> tuple[bytes, list[Any], dict[str, float]] | None:
    """The view's bytes (struct Cwbvh), the arrays that it points to, and statistics as the CPU's builders give.

    positions (V, 3) float32, triangles (T, 3) uint32, flags (T,) uint8 or empty. None where the CPU must build: few
    triangles, or a tree deeper than any walk may go.
    """
    return build_cwbvh_of(corners_of(positions, triangles), flags) if len(triangles) >= FEWEST else None


def build_cwbvh_of(corners: Any, flags: Any) -> tuple[bytes, list[Any], dict[str, float]] | None:
    """As build_cwbvh. corners: (T, 9) float32; triangles of no area are left out."""
    cp, triangles = cupy(), len(corners)
    if triangles < FEWEST:
        return None
    start, end = cp.cuda.Event(), cp.cuda.Event()
    start.record()
    build = Build(cp.asarray(corners), cp.asarray(flags))
    count = _sort(build, triangles)
    if count < FEWEST:
        return None
    _merge(build, count)
    depth = _collapse(build, count)
    end.record()
    end.synchronize()
    if depth > MAX_DEPTH:
        return None
    nodes, leaves = build.counter(WIDE_NODES), build.counter(LEAVES)
    wide = build.arrays["wide"][: nodes * NODE_BYTES].copy()  # frees what was reserved for the worst tree
    stored = build.arrays["leaves"][: leaves * LEAF_BYTES].copy()
    view = struct.pack("<QQ6fII", wide.data.ptr, stored.data.ptr, *build.box, nodes, depth)
    stats = {"primitives": count, "dropped": triangles - count, "nodes": nodes, "references": leaves,
             "depth": depth, "bytes": wide.nbytes + stored.nbytes, "primitive_bytes": 36 * triangles,
             "build_seconds": cp.cuda.get_elapsed_time(start, end) / 1000}  # fmt: skip
    return view, [wide, stored], stats


def _sort(build: Build, triangles: int) -> int:
    """Boxes of the usable triangles in the order of the curve; how many there are."""
    cp, arrays = cupy(), build.arrays
    arrays["usable"] = cp.empty(triangles, np.uint8)
    build.run("mark_usable", triangles)
    refs = arrays["refs"] = cp.flatnonzero(arrays["usable"]).astype(np.uint32)
    count = len(refs)
    if count < FEWEST:
        return count
    arrays["boxes"], arrays["keys"] = cp.empty((count, 6), np.float32), cp.empty(count, np.uint64)
    build.run("make_boxes", count)
    low = cp.asnumpy(arrays["boxes"][:, :3].min(0))
    high = cp.asnumpy(arrays["boxes"][:, 3:].max(0))
    extent = float((high.astype(np.float64) - low).max())
    # The curve's cells are cubes: with a scale for each axis a flat scene would be cut along the short one first.
    build.low, build.scale = tuple(map(float, low)), float(min(2.0**21 / max(extent, 1e-30), 1e37))
    build.box = (*build.low, *map(float, high))
    build.run("make_keys", count)
    order = cp.argsort(arrays["keys"])
    for name in ("refs", "boxes", "keys"):
        arrays[name] = cp.ascontiguousarray(arrays[name][order])
    return count


def _merge(build: Build, count: int) -> None:
    cp, arrays = cupy(), build.arrays
    arrays["nodes"] = cp.empty(32 * (2 * count - 1), np.uint8)
    arrays["sizes"] = cp.empty(2 * count - 1, np.uint32)
    arrays["clusters"], arrays["arrived"] = cp.empty(count, np.uint32), cp.empty(count, np.uint32)
    arrays["counters"] = cp.asarray(np.array([count, 0, 1, 0, 0], np.uint32))
    build.run("make_leaves", count)
    build.run("merge", count)


def _collapse(build: Build, count: int) -> int:
    """Level by level; returns the levels below the root."""
    cp, arrays = cupy(), build.arrays
    room = count // 2 + 8  # nodes: all that have inner children have eight, and every leaf child a primitive
    arrays["wide"], arrays["leaves"] = cp.empty(NODE_BYTES * room, np.uint8), cp.empty(LEAF_BYTES * count, np.uint8)
    lists = [cp.empty(2 * room, np.uint32) for _ in range(2)]
    lists[0][:2] = cp.asarray(np.array([build.counter(ROOT), 0], np.uint32))
    items, depth = 1, -1
    while items > 0:
        depth += 1
        arrays["items"], arrays["next_items"] = lists
        build.run("collapse", items)
        items = build.counter(ITEMS)
        arrays["counters"][ITEMS] = 0
        lists.reverse()
    return depth

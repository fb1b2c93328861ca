"""Rays of a render through the scene's trees on a GPU: the kernels of native/cuda/render/trace.cuh."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from luch.cuda.compiler import load
from luch.cuda.device import Kernel, cupy
from luch.cuda.upload import Blocks, DeviceCopy, Links

BLOCK = 128  # RAY_BLOCK of rays/structure.cuh
HIT = np.dtype([("t", "<f4"), ("prim", "<i4"), ("instance", "<i4"), ("u", "<f4"), ("v", "<f4")])  # luch::Hit; -1: NONE


class SceneTracer:
    """A scene's trees on the current device, and their kernels."""

    def __init__(self, blocks: Blocks, links: Links, kind: str, precision: str, one_group: bool) -> None:
        """blocks, links: cpu::SceneTrees::append's. kind: a structure, as "CWBVH". precision: what it was built for."""
        self._trees = DeviceCopy(blocks, links)
        one = "_one" if one_group and kind == "CWBVH" else ""
        module = load(f"TRACE_{kind}", precision)
        self._closest, self._any = module.kernel(f"trace_closest{one}"), module.kernel(f"trace_any{one}")

    @property
    def root(self) -> Any:
        """The view's bytes (TwoLevelView), a kernel's parameter."""
        return self._trees.root

    @property
    def bytes(self) -> int:
        """On the device."""
        return self._trees.bytes

    def closest(self, rays: int, kinds: int, hits: int, count: int, following: int) -> None:
        """Puts it on the current stream. All are addresses on the device.

        rays: 32 bytes each (luch::Ray), 16 bytes aligned; kinds: uint32 each, or 0; hits: HIT each; count: uint32, how
        many; following: uint32, must be 0 when the kernel begins.
        """
        self._launch(self._closest, rays, kinds, hits, 0, count, following)

    def any(self, rays: int, kinds: int, blocked: int, count: int, following: int) -> None:
        """As above. blocked: uint8 each, luch::Blocked."""
        self._launch(self._any, rays, kinds, 0, blocked, count, following)

    def _launch(self, kernel: Kernel, *task: int) -> None:
        kernel.launch(kernel.resident_blocks(BLOCK), BLOCK, [self._trees.root, struct.pack("<6Q", *task)])

    def closest_of(self, rays: Any, kinds: Any = None) -> Any:
        """rays (N, 8) float32, kinds (N,) uint32 or None: NumPy in, HIT (N,) out. For tests and races."""
        return self._traced(self._closest, rays, kinds, HIT)

    def any_of(self, rays: Any, kinds: Any = None) -> Any:
        """As above; Blocked values (N,) uint8."""
        return self._traced(self._any, rays, kinds, np.dtype(np.uint8))

    def _traced(self, kernel: Kernel, rays: Any, kinds: Any, result: Any) -> Any:
        cp, count = cupy(), len(rays)
        rays = cp.asarray(rays)
        kinds = cp.zeros(0, np.uint32) if kinds is None else cp.asarray(kinds)
        out = cp.zeros(count * result.itemsize, np.uint8)
        counts = cp.asarray(np.array([count, 0], np.uint32))
        outputs = (out.data.ptr, 0) if result == HIT else (0, out.data.ptr)
        self._launch(kernel, rays.data.ptr, kinds.data.ptr if kinds.size else 0, *outputs, counts.data.ptr,
                     counts.data.ptr + 4)  # fmt: skip
        return cp.asnumpy(out).view(result)

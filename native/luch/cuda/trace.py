"""Rays of a render through the scene's trees on a GPU: the kernels of native/cuda/render/trace.cuh."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from luch.cuda.builder import MAX_DEPTH, build_cwbvh_of
from luch.cuda.compiler import load
from luch.cuda.device import DeviceError, Kernel, cupy
from luch.cuda.memory import Memory
from luch.cuda.plan import curve_flags
from luch.cuda.upload import Blocks, DeviceCopy, Links

BLOCK = 128  # RAY_BLOCK of rays/structure.cuh
MOVING = ("-DLUCH_PLAN_MOTION=1",)
TIMED_RAYS = ("-DLUCH_TIMED_RAYS=1",)
HIT = np.dtype([("t", "<f4"), ("prim", "<i4"), ("instance", "<i4"), ("u", "<f4"), ("v", "<f4")])  # luch::Hit; -1: NONE


# Of a group that is left for the device: corners (T, 9) float32, flags, and (block, offset) where its view belongs.
Left = Sequence[tuple[Any, Any, list[tuple[int, int]]]]


class TreesTooDeep(DeviceError):
    """What the device built is deeper than any walk may go: build all on the CPU."""


def upload_trees(blocks: Blocks, links: Links, left: Left, depth: int) -> DeviceCopy:
    """cpu::SceneTrees on the current device, the trees of `left` built there. depth: of those that are not left."""
    whole, kept = list(blocks), []
    for corners, flags, places in left:
        made = build_cwbvh_of(corners, flags)
        if made is None or made[2]["depth"] + depth >= MAX_DEPTH:
            raise TreesTooDeep("The scene's trees are too deep for the GPU.")
        view, arrays, _stats = made
        kept += arrays
        for block, offset in places:
            name, data = whole[block]
            patched = np.array(data, np.uint8)
            patched[offset : offset + len(view)] = np.frombuffer(view, np.uint8)
            whole[block] = name, patched
    copy = DeviceCopy(whole, links)
    copy.arrays += kept
    return copy


def ray_kernels(
    kind: str, world_apart: bool, moves: bool, curves: str, timed: bool = False
) -> tuple[tuple[str, ...], str]:
    """What the module TRACE_{kind} is compiled with, and how the names of its kernels end, for such trees: as
    SceneTracer has them."""
    return MOVING * moves + curve_flags(curves) + TIMED_RAYS * timed, "_one" * (world_apart and kind == "CWBVH")


class SceneTracer:
    """A scene's trees on the current device, and their kernels."""

    def __init__(self, blocks: Blocks, links: Links, kind: str, precision: str, world_apart: bool, left: Left = (),
                 depth: int = 0, moves: bool = False, curves: str = "", timed: bool = False,
                 goes_on: Callable[[], bool] | None = None) -> None:  # fmt: skip
        """blocks, links: cpu::SceneTrees::append's. kind: a structure, as "CWBVH". precision: what it was built for.

        world_apart: one group is all of the scene, or all that stands still where the rest moves; left: groups that the
        device builds, if any; depth: of the trees that were built; moves: something in them does; curves: the
        Settings.curve_shape of the hair that some group holds, "" without; timed: `ticks` of closest() and any() are
        written. Kernels lack the code of what is not asked for. goes_on: as in luch.cuda.compiler.load. May raise
        TreesTooDeep.
        """
        self._trees = upload_trees(blocks, links, left, depth)
        flags, one = ray_kernels(kind, world_apart, moves, curves, timed)
        self._module = load(f"TRACE_{kind}", precision, flags, goes_on)
        self._closest, self._any = self.kernel(f"trace_closest{one}"), self.kernel(f"trace_any{one}")
        # What moves comes after what stands still, which is found as if nothing moved.
        self._then: dict[str, Kernel] = {}
        if one and moves:
            self._then = {
                kernel.name: self.kernel(kernel.name.removesuffix(one)) for kernel in (self._closest, self._any)
            }

    @property
    def root(self) -> Any:
        """The view's bytes (TwoLevelView), a kernel's parameter."""
        return self._trees.root

    @property
    def bytes(self) -> int:
        """On the device."""
        return self._trees.bytes

    def kernel(self, name: str) -> Kernel:
        """One of the module's."""
        return self._module.kernel(name)

    def closest(self, rays: int, kinds: int, hits: int, count: int, following: int, near: int, times: int = 0,
                ticks: int = 0) -> None:  # fmt: skip
        """Puts it on the current stream. All are addresses on the device.

        rays: 32 bytes each (luch::Ray), 16 bytes aligned; kinds: uint32 each, or 0; hits: HIT each; count: uint32, how
        many; following: three uint32, must be 0 when the kernels begin; near: room for a uint32 each, where those are
        noted that may meet what moves, or 0 where nothing does; times: float32 each, or 0; ticks: uint32 each, or 0.
        """
        self._launch(self._closest, rays, kinds, hits, 0, count, following, times, ticks, near)

    def closest_of_wave(self, memory: Memory, turn: int) -> None:
        """The same of all rays under way in a wavefront's round."""
        following = "next_" if turn else ""
        self.closest(memory.address(f"{following}rays"), memory.address("next_kind" if turn else "ray_kind"),
                     memory.address("hits"), memory.counter("rays"), memory.counter("traced"),
                     memory.near_movers.data.ptr, memory.address("next_time" if turn else "ray_time"),
                     memory.address("ray_ticks"))  # fmt: skip

    def any(self, rays: int, kinds: int, blocked: int, count: int, following: int, near: int, times: int = 0,
            ticks: int = 0) -> None:  # fmt: skip
        """As above. blocked: uint8 each, luch::Blocked."""
        self._launch(self._any, rays, kinds, 0, blocked, count, following, times, ticks, near)

    def _launch(self, kernel: Kernel, *task: int) -> None:
        arguments = [self._trees.root, struct.pack("<9Q", *task)]
        kernel.launch(kernel.resident_blocks(BLOCK), BLOCK, arguments)
        then = self._then.get(kernel.name)
        if then is not None:
            then.launch(then.resident_blocks(BLOCK), BLOCK, arguments)

    def closest_of(self, rays: Any, kinds: Any = None, kernel: str = "", times: Any = None) -> Any:
        """rays (N, 8) float32, kinds (N,) uint32 or None, times (N,) float32 or None: NumPy in, HIT (N,) out.

        For tests and races.
        """
        results, run = self.launcher(self.kernel(kernel) if kernel else self._closest, rays, kinds, times)
        run()
        return cupy().asnumpy(results).view(HIT)

    def any_of(self, rays: Any, kinds: Any = None, kernel: str = "", times: Any = None) -> Any:
        """As above; Blocked values (N,) uint8."""
        results, run = self.launcher(self.kernel(kernel) if kernel else self._any, rays, kinds, times)
        run()
        return cupy().asnumpy(results)

    def launcher(
        self, kernel: Kernel, rays: Any, kinds: Any = None, times: Any = None
    ) -> tuple[Any, Callable[[], None]]:
        """The results' bytes on the device, and what traces the rays into them, again and again."""
        cp, blocked = cupy(), kernel.name.startswith("trace_any")
        rays = cp.asarray(rays)
        kinds = None if kinds is None or not len(kinds) else cp.asarray(kinds)
        times = None if times is None else cp.asarray(times)
        results = cp.zeros(len(rays) * (1 if blocked else HIT.itemsize), np.uint8)
        counts = cp.asarray(np.array([len(rays), 0, 0, 0], np.uint32))
        near = cp.empty(len(rays), np.uint32)

        def run() -> None:
            counts[1:] = 0
            outputs = (0, results.data.ptr) if blocked else (results.data.ptr, 0)
            self._launch(kernel, rays.data.ptr, 0 if kinds is None else kinds.data.ptr, *outputs, counts.data.ptr,
                         counts.data.ptr + 4, 0 if times is None else times.data.ptr, 0, near.data.ptr)  # fmt: skip

        return results, run

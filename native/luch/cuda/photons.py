"""Photon maps on a GPU: photons go through the wavefront's own queues, and CuPy sorts them where they land.

The same photons in the same order as on the CPU, so that the picture is the same: core.render tells which map serves a
sample, how many photons start, and how far is looked for them.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from luch._native import core
from luch.cuda.device import cupy
from luch.cuda.memory import BLOCK, Memory

# Photons started at once, at most, and records that there is room for at first, for each of them: it leaves one, or few.
MOST_AT_ONCE = 1 << 20
RECORDS = 2.0


def bytes_of_maps(pixels: int) -> int:
    """What the largest map of such a picture may take, with what sorts it."""
    sizes = core.render.task_sizes()
    record = 3 * sizes["photon"] + 16 + core.photons.layout()["level_count"] * (sizes["photon_place"] + 4)
    return int(core.photons.starts(pixels) * core.photons.MOST_SAMPLES_OF_MAP * record)


class PhotonMaps:
    """The maps of one picture on the current device."""

    def __init__(self, memory: Memory, paths: Any, stages: Any, tracer: Any, most_rounds: int, facts: dict[str, Any],
                 goes_on: Callable[[], bool]) -> None:  # fmt: skip
        """memory: of a renderer, whose waves are at rest meanwhile; paths, stages: its kernels; tracer: SceneTracer."""
        self._memory, self._paths, self._stages, self._tracer = memory, paths, stages, tracer
        self._most_rounds, self._reach, self._goes_on = most_rounds, float(facts["casters_reach"]), goes_on
        self._layout = core.photons.layout()
        self._record = core.render.task_sizes()["photon"]
        self._starts = core.photons.starts(memory.pixels)
        self._map: int | None = None  # that is at hand
        self._pilot: Any = None
        self._expected: list[Any] = []
        self._held: list[Any] = []  # arrays of the map
        self.stats = {"photons": 0, "photons_landed": 0, "photon_maps": 0, "photon_radius_m": 0.0,
                      "photon_map_bytes": 0, "photon_seconds": 0.0}  # fmt: skip

    def serve(self, sample: int) -> bool:
        """Makes the map that serves a sample, unless it is at hand. False when cancelled."""
        number = core.photons.first_of_map(sample)
        if number == self._map:
            return True
        began = time.perf_counter()
        if self._pilot is None and not self._look():
            return False
        starts = self._starts * core.photons.samples_of_map(number, core.photons.MOST_SAMPLES_OF_MAP)
        photons = self._trace(number, starts)
        if photons is None:
            return False
        self._point(photons, self._pilot.map(number, starts, len(photons)))
        self._map = number
        self.stats["photon_maps"] += 1
        cupy().cuda.get_current_stream().synchronize()
        self.stats["photon_seconds"] += time.perf_counter() - began
        return True

    def _look(self) -> bool:
        """The pilot: how far to look for photons, and where."""
        photons = self._trace(self._layout["pilot_map"], core.photons.pilot_starts(self._memory.pixels))
        if photons is None:
            return False
        records = cupy().asnumpy(photons).view(np.uint8).reshape(-1)
        self._pilot = core.photons.PhotonPilot(records, self._memory.pixels, self._reach)
        self._expected = [cupy().asarray(level) for level in self._pilot.expected()]
        return True

    def _trace(self, number: int, starts: int) -> Any:
        """Records of photons, uint32 (N, 16), in their order; None when cancelled."""
        cp, at_once, pieces = cupy(), min(MOST_AT_ONCE, self._memory.slots), []
        for first in range(0, starts, at_once):
            count = min(at_once, starts - first)
            wanted = max(1, int(count * RECORDS))
            while True:
                room = cp.empty((wanted, self._record // 4), np.uint32)
                landed = self._trace_some(number, first, count, room)
                if landed is None:
                    return None
                if landed <= wanted:
                    break
                wanted = landed  # the same photons again
            pieces.append(room[:landed].copy())
            self.stats["photons_landed"] += landed
        self.stats["photons"] += starts
        photons = pieces[0] if len(pieces) == 1 else cp.concatenate(pieces)
        start, bounce = (photons[:, self._layout[name]].astype(np.uint64) for name in ("start_word", "bounce_word"))
        order = cp.argsort(start << np.uint64(8) | bounce)
        return cp.ascontiguousarray(photons[order])

    def _trace_some(self, number: int, first: int, count: int, room: Any) -> int | None:
        """How many records photons [first, first + count) have left, also where there was no room; None: cancelled."""
        memory, paths = self._memory, self._paths
        landed = cupy().zeros(1, np.uint32)
        memory.lend(room, landed)
        memory.clear("rays")
        memory.launch(self._stages.kernel("begin_photons"), 0, count, struct.pack("<3I", number, first, count))
        turn, left, rays = 0, self._most_rounds, memory.count("rays")
        while rays and left:
            if not self._goes_on():
                memory.clear("rays")
                return None
            left -= 1
            self._tracer.closest_of_wave(memory, turn)
            memory.sort_hits(paths, turn, rays)
            memory.launch(self._stages.kernel("shade_photons"), turn, rays)
            memory.launch(paths.kernel("next_round"), turn, 1)
            turn ^= 1
            rays = memory.count("rays")
        memory.clear("rays")
        return int(landed.get()[0])

    def _point(self, photons: Any, described: bytes) -> None:
        """Sorts the photons for every level, and tells the task of them."""
        cp, layout, count = cupy(), self._layout, len(photons)
        view, keys = bytearray(described), cp.empty(count, np.uint64)
        self._held = [photons]
        struct.pack_into("<Q", view, layout["photons"], photons.data.ptr if count else 0)
        for number in range(layout["level_count"]):
            at = layout["levels"] + number * layout["level_size"]
            mask = struct.unpack_from("<I", view, at + layout["mask"])[0]
            radius, cell = (view[at + layout[name] : at + layout[name] + 4] for name in ("radius", "inverse_cell"))
            given = [struct.pack("<Q", photons.data.ptr), struct.pack("<I", count)]
            places = cp.empty(count * core.render.task_sizes()["photon_place"], np.uint8)
            if count:
                kernel = self._paths.kernel("bucket_photons")
                kernel.launch(-(-count // BLOCK), BLOCK, [*given, bytes(cell), struct.pack("<I", mask),
                                                          struct.pack("<Q", keys.data.ptr)])  # fmt: skip
                order = cp.sort(keys)
                self._paths.kernel("place_photons").launch(
                    -(-count // BLOCK), BLOCK, [*given, struct.pack("<Q", order.data.ptr), struct.pack("<Q", places.data.ptr)]
                )  # fmt: skip
                buckets = (order >> np.uint64(32)).astype(np.uint32)
            else:
                buckets = cp.zeros(0, np.uint32)
            first = cp.searchsorted(buckets, cp.asarray(np.arange(mask + 2, dtype=np.uint32))).astype(np.uint32)
            self._held += [places, first]
            for name, array in (("places", places), ("first", first), ("expected", self._expected[number])):
                struct.pack_into("<Q", view, at + layout[name], array.data.ptr)
            if number == 0:
                self.stats["photon_radius_m"] = struct.unpack("<f", radius)[0]
        self._memory.place("scene.photons", bytes(view))
        self.stats["photon_map_bytes"] = sum(int(array.nbytes) for array in self._held)

"""The film and the wavefront on a device: how large they are, and where in them what lies."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np

from luch._native import core
from luch.cuda.device import cupy

BLOCK = 128  # STAGE_BLOCK of render/launch.cuh
NONE = 0xFFFFFFFF  # of luch/platform.h: not there
MARK_CHANNELS = 4  # of luch/film/film.h
RAY_CAMERA, RAY_SHADOW = 1, 32  # RayKind of luch/geometry/ray.h
COUNTERS = (
    "rays",
    "next_rays",
    "shadows",
    "hits",
    "traced",
    "traced_after",
    "near_movers",
    "shadowed",
    "shadowed_after",
    "shadows_near_movers",
    "walks",
    "walked",
    "see_through",
)  # WaveCounter


class Beside(NamedTuple):
    """What paths have beside what all of them have."""

    walks: bool = False  # they may go under surfaces
    media: bool = False  # and through volumes
    moves: bool = False  # each has a time of its own
    timed: bool = False  # and is timed
    transparent: bool = False  # its shadow rays may see through surfaces


class Memory:
    """The film and the wavefront on the device, and their places in the RenderTask."""

    def __init__(self, task: bytes, pixels: int, materials: int, paths: int, beside: Beside) -> None:
        """paths: so many at once, or a few less."""
        self._fields, self.beside = core.render.task_fields(), beside
        self.all_that_fits = False  # more paths were wanted than the device has room for
        self._film = cupy().empty(0, np.float64)
        self.near_movers = cupy().empty(0, np.uint32)  # rays that what moves concerns (luch.cuda.trace)
        self._lay_out(task, pixels, paths)
        self.held = self.slots
        self._allocate(materials)
        self._point()

    def restart(self, task: bytes, pixels: int, paths: int) -> bool:
        """For another picture of the same scene, of at most `held` paths at once: the film's sums begin anew.

        To be asked first: serves(). False: there is no room for so large a film beside the wavefront.
        """
        try:
            self._lay_out(task, pixels, min(paths, self.held))
        except cupy().cuda.memory.OutOfMemoryError:
            return False
        for name in ("counters", "totals", "material_first"):
            self.arrays[name].fill(0)
        self._point()
        return True

    def serves(self, task: bytes, beside: Beside) -> bool:
        """Whether what paths have beside them here is what they need there."""
        wanted = self._queued(task, beside), self.field("film.layout.aov_count", task)
        return beside == self.beside and wanted == (self._shadows, self._aovs) and not beside.timed

    def _queued(self, task: bytes | bytearray, beside: Beside) -> int:
        """Shadow rays of one path that may wait at once."""
        occlusion = self.field("film.layout.ambient_occlusion", task) != NONE
        return 1 + occlusion + beside.walks + beside.media

    def _lay_out(self, task: bytes, pixels: int, paths: int) -> None:
        """The film, all 0, and how pixels and samples share the slots."""
        self._task = bytearray(task)
        stride = self.field("film.layout.stride")
        self._aovs = self.field("film.layout.aov_count")
        self._shadows = self._queued(task, self.beside)
        self.layer_pixels = min(pixels, paths)
        self.layers = max(1, paths // pixels)
        self.slots = self.layer_pixels * self.layers
        self.pixels, self.stride = pixels, stride
        sums = self.layers * pixels * stride
        if self._film.size < sums:
            self._film = cupy().empty(0, np.float64)  # freed before its successor is there
            self._film = cupy().empty(sums, np.float64)
        self.rows = self._film[:sums].reshape(self.layers, pixels, stride)
        self.rows.fill(0.0)
        self.counts = cupy().zeros((self.layers, pixels), np.uint32)

    def _allocate(self, materials: int) -> None:
        cp, sizes, slots, shadows, beside = (
            cupy(), core.render.task_sizes(), self.held, self._shadows, self.beside
        )  # fmt: skip

        def empty(count: int, kind: Any = np.uint8) -> Any:
            return cp.empty(count, kind)

        self.counters, self.totals = cp.zeros(sizes["counters"], np.uint32), cp.zeros(sizes["totals"], np.uint64)
        self.arrays = {
            "paths": empty(slots * sizes["path"]),
            "rays": empty(slots * sizes["ray"]),
            "ray_slot": empty(slots, np.uint32),
            "ray_kind": empty(slots, np.uint32),
            "next_rays": empty(slots * sizes["ray"]),
            "next_slot": empty(slots, np.uint32),
            "next_kind": empty(slots, np.uint32),
            "hits": empty(slots * sizes["hit"]),
            "sorted": empty(slots, np.uint32),
            "material_first": cp.zeros(materials, np.uint32),
            "shadow_rays": empty(slots * shadows * sizes["ray"]),
            "shadows": empty(slots * shadows * sizes["shadow"]),
            "shadow_kind": cp.full(slots * shadows, RAY_SHADOW, np.uint32),
            "blocked": empty(slots * shadows),
            "counters": self.counters,
            "totals": self.totals,
        }
        if beside.walks:
            self.arrays["walks"] = empty(slots * sizes["walk"])
        if beside.moves:
            self.near_movers = empty(slots * shadows, np.uint32)
            self.arrays |= {
                "ray_time": empty(slots, np.float32),
                "next_time": empty(slots, np.float32),
                "shadow_time": empty(slots * shadows, np.float32),
            }
        if beside.timed:
            self.arrays |= {
                "ticks": cp.zeros((sizes["clocks"], slots), np.uint32),
                "ray_ticks": empty(slots, np.uint32),
                "shadow_ticks": empty(slots * shadows, np.uint32),
            }
        if beside.transparent:
            self.arrays["see_through"] = empty(slots * shadows, np.uint32)
        if self._aovs:
            self.arrays["aovs"] = empty(slots * self._aovs * 4, np.float32)
        if beside.media:
            self.arrays["media"] = empty(slots * sizes["media"])
            self.arrays["shadow_media"] = empty(slots * shadows * sizes["media"])

    def _point(self) -> None:
        """The task's pointers, and those of the round after."""
        beside = self.beside
        self._set("film.rows", "<Q", self.rows.data.ptr)
        self._set("film.sample_counts", "<Q", self.counts.data.ptr)
        self._set("wave.slots", "<I", self.slots)
        self._set("wave.layer_pixels", "<I", self.layer_pixels)
        self._set("wave.layer_stride", "<Q", self.pixels * self.stride)
        self._set("wave.film_pixels", "<I", self.pixels)
        for name, array in self.arrays.items():
            self._set(f"wave.{name}", "<Q", array.data.ptr)
        self.tasks = [bytes(self._task), b""]
        for name in ("rays", "slot", "kind", *(("time",) if beside.moves else ())):
            own, following = ("rays", "next_rays") if name == "rays" else (f"ray_{name}", f"next_{name}")
            self._set(f"wave.{own}", "<Q", self.arrays[following].data.ptr)
            self._set(f"wave.{following}", "<Q", self.arrays[own].data.ptr)
        self.tasks[1] = bytes(self._task)

    def field(self, name: str, task: bytes | bytearray | None = None) -> int:
        """A uint32 of the task, or of another one."""
        value: int = struct.unpack_from("<I", self._task if task is None else task, self._fields[name])[0]
        return value

    def _set(self, name: str, kind: str, value: int) -> None:
        struct.pack_into(kind, self._task, self._fields[name], value)

    def lend(self, room: Any, count: Any) -> None:
        """Where photons land: records, and how many there are, on the device."""
        self.place("wave.landed", struct.pack("<Q", room.data.ptr))
        self.place("wave.landed_count", struct.pack("<Q", count.data.ptr))
        self.place("wave.landed_room", struct.pack("<I", len(room)))

    def place(self, name: str, data: bytes) -> None:
        """Into the tasks of both turns."""
        at = self._fields[name]
        self._task[at : at + len(data)] = data
        self.tasks = [task[:at] + data + task[at + len(data) :] for task in self.tasks]

    def launch(self, kernel: Any, turn: int, threads: int, *more: bytes) -> None:
        """A stage, one thread an entry. turn: which of the two queues of rays is this round's."""
        kernel.launch(-(-threads // BLOCK), BLOCK, [self.tasks[turn], *more])

    def sort_hits(self, paths: Any, turn: int, rays: int) -> None:
        """By material. paths: the module RENDER_PATHS."""
        self.launch(paths.kernel("count_materials"), turn, rays)
        self.launch(paths.kernel("place_materials"), turn, 1)
        self.launch(paths.kernel("sort_hits"), turn, rays)

    def address(self, name: str) -> int:
        """Of an array on the device; 0 if this scene needs no such array."""
        return int(self.arrays[name].data.ptr) if name in self.arrays else 0

    def counter(self, name: str) -> int:
        """Address of one of WaveCounter."""
        return int(self.counters.data.ptr) + 4 * COUNTERS.index(name)

    def clear(self, *names: str) -> None:
        """Sets some of WaveCounter to 0, on the device."""
        for index in map(COUNTERS.index, names):
            self.counters[index : index + 1].fill(0)

    def count(self, name: str) -> int:
        """Of one of WaveCounter; waits for the device."""
        index = COUNTERS.index(name)
        return int(self.counters[index : index + 1].get()[0])

    def mark(self, sample: int, pixels: Any = None) -> None:
        """As film_mark of luch/film/film.h, of every layer and pixel (or of those in a list on the device).

        To be called before that sample.
        """
        marks = self.field("film.layout.marks")
        if marks == NONE or sample == 0 or sample & (sample - 1):
            return
        channel = marks + (0 if sample & 0x55555555 else MARK_CHANNELS)
        those = slice(None) if pixels is None else pixels
        self.rows[:, those, channel : channel + 3] = self.rows[:, those, :3]  # Combined comes first
        self.rows[:, those, channel + 3] = self.counts[:, those]

    @property
    def bytes(self) -> int:
        """All of it."""
        arrays = [self._film, self.counts, self.near_movers, *self.arrays.values()]
        return sum(int(array.nbytes) for array in arrays)


def bytes_per_path(stride: int, beside: Beside) -> float:
    """Device memory of one path under way: its state, its queues, and its part of a layer of the film."""
    sizes = core.render.task_sizes()
    walks, media, moves, timed, transparent = beside
    shadow = sizes["ray"] + sizes["shadow"] + 5 + media * sizes["media"] + 4 * transparent
    queues = 2 * (sizes["ray"] + 8) + sizes["hit"] + 4 + (2 + walks + media) * shadow
    rest = walks * sizes["walk"] + media * sizes["media"]
    times = 4 * (6 + 2 * (walks + media)) * moves
    ticks = 4 * (sizes["clocks"] + 3 + walks + media) * timed
    return float(sizes["path"] + queues + rest + times + ticks + 8 * stride + 4)

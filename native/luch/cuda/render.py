"""Renders on a GPU: waves of paths through the stages of native/cuda/render, driven from here.

``DeviceRenderer`` has the methods of ``core.render.Renderer`` that ``luch.render`` uses, on one device
(``luch.cuda.several`` shares samples among many). The scene is read, and its
lights are built, by the core on the host; the film's sums stay on the device until somebody asks for passes.
"""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np

from luch._native import core
from luch.adaptive import parts, regions_of
from luch.cuda.compiler import NotWanted, load
from luch.cuda.device import DeviceError, cupy, describe, enter_context
from luch.cuda.host import HostFilm, HostScene
from luch.cuda.memory import BLOCK, NONE, RAY_CAMERA, Beside, Memory, bytes_per_path
from luch.cuda.photons import PhotonMaps, bytes_of_maps
from luch.cuda.plan import sampler_flags
from luch.cuda.scene_kernels import SceneKernels
from luch.cuda.timing import TIMED, StageClocks
from luch.cuda.trace import MOVING, Left, SceneTracer, TreesTooDeep
from luch.cuda.upload import PIXELS, Blocks, DeviceCopy, Links, images_to_leave, too_large
from luch.ledger import REFUSALS

# Paths under way at once, for each multiprocessor, rounded down to a power of two. Late bounces of few paths leave a GPU
# idle: on an H100 (132 of them) waves of 2, 4, 8 and 16 million took 4.9, 3.6, 3.0 and 2.8 s for little_lamp, 12.2, 10.1,
# 9.1 and 8.8 s for white_room. More only cost memory and time until a cancel is heard, which is a wave's.
PATHS_OF_MULTIPROCESSOR = 1 << 16
MOST_PATHS = 1 << 24
FEWEST_PATHS = 1 << 14
# Part of the free memory that a wavefront and its film may take.
MEMORY_SHARE = 0.85
# Part of the free memory that a scene may take; film and paths want some, too.
SCENE_SHARE = 0.8
TREE_BYTES = 200  # of a triangle whose tree the device builds: its corners, its node's share, the builder's work space
TOTALS = ("surface_points", "transparent_steps", "transparent_rays", "world_points",
          "light_points", "subsurface_walks", "subsurface_steps", "flights", "clamped_units", "cut_units", *REFUSALS)  # WaveTotal  # fmt: skip


# Pixels of the film, in order (None: all), and their samples: the first and how many.
Part = tuple[Any, int, int]


def parted(first: int, count: int, most: int, by_maps: bool = False) -> Iterator[tuple[int, int]]:
    """Samples [first, first + count) as (first, count) of at most so many, none across a power of two: marks lie there.

    by_maps: each of one photon map.
    """
    end = first + count
    while first < end:
        count = min(most, end - first, (1 << first.bit_length()) - first)
        if by_maps:
            count = core.photons.samples_of_map(first, count)
        yield first, count
        first += count


def _on_device(pixels: Any) -> Any:
    """A list of them, uint32; None (all of them) stays."""
    return None if pixels is None else cupy().asarray(np.asarray(pixels, np.uint32))


def _told_images(sizes: list[int]) -> list[str]:
    if not sizes:
        return []
    count = "1 image stays" if len(sizes) == 1 else f"{len(sizes)} images stay"
    return [
        f"{count} in the host's memory ({sum(sizes) / 1e6:.3g} MB): the GPU's has no room, and reads them more slowly."
    ]


class DeviceRenderer(HostFilm):
    """One scene on the current CUDA device. Raises DeviceError where there is none, or its memory is too small."""

    def __init__(self, scene: Any, host: HostScene | None = None) -> None:
        """scene: luch.scene.Scene. Raises ValueError, naming the object, for data that does not fit together.

        host: several devices share one.
        """
        self._device = cupy().cuda.Device()
        super().__init__(host or HostScene(scene))
        self._lock = threading.Lock()
        self._held: Memory | None = None
        self._photons: PhotonMaps | None = None
        self._stages: SceneKernels
        self._timed = "Render Time" in scene.film.passes
        self.warnings: list[str] = []
        self._begin(scene)

    def _begin(self, scene: Any) -> None:
        """Nothing of the picture is there yet."""
        self._scene = scene
        self._cancelled = self._abandoned = False
        self.compiling = False  # what prepare() waits for, or waited for last
        self._waves_done = self._waves = 0
        self._counts = {"paths": 0, "rays": 0, "shadow_rays": 0}
        self._trace_seconds = self._upload_seconds = 0.0
        self._uncharged = 0.0  # since when no time was shared among pixels, by the clock of perf_counter
        self._merged = self._on_host = True  # the film's layers in one, and that one

    @property
    def device(self) -> str:
        """For the statistics."""
        with self._device:
            return f"CUDA: {describe()['device']}"

    def prepare(self) -> bool:
        """Builds structures and lights, uploads them, makes the kernels. False when cancelled."""
        try:
            ready = self._host.prepare() and self.prepare_device()
        except TreesTooDeep:
            ready = self._host.build_all() and self.prepare_device()
        self._host.images = None  # they are on the device
        return ready

    def prepare_device(self) -> bool:
        """Uploads what the host has built, makes the kernels. False when cancelled. May raise TreesTooDeep."""
        with self._device:
            try:
                return not self._cancelled and self._prepare()
            except NotWanted:
                return False

    def set_view(self, scene: Any) -> bool:
        """As core.render.Renderer's. False: this view needs a renderer of its own."""
        view = self._host.set_view(scene)
        return view is not None and self.set_device_view(scene, *view)

    def set_device_view(self, scene: Any, facts: dict[str, Any], blocks: Blocks, links: Links) -> bool:
        """The same for this device, of what its host has made of the view."""
        if self._timed or "Render Time" in scene.film.passes:
            return False
        with self._device:
            enter_context()
            began = time.perf_counter()
            self._begin(scene)
            if not self._arrays.refresh(blocks, links):
                return False
            if not self._stages.serve(facts, scene):
                try:
                    self._stages = SceneKernels(facts, blocks, scene, self._goes_on)
                except NotWanted:
                    return False
            self._prepare_waves(facts)
            self._upload_seconds = time.perf_counter() - began
        return True

    def rest(self) -> None:
        """Gives the wavefront's and the film's memory back; set_view() takes it again. Passes are to be read before."""
        with self._device:
            enter_context()
            self._held = self._photons = None
            cupy().get_default_memory_pool().free_all_blocks()

    def origin_reach(self) -> float:
        """As core.render.Renderer's."""
        rays = self._host.core.probe_rays()
        with self._lock, self._device:
            enter_context()
            hits = self._tracer.closest_of(rays, np.full(len(rays), RAY_CAMERA, np.uint32))
        return float(self._host.core.origin_reach_of(hits["t"], hits["instance"].view(np.uint32)))

    def _prepare(self) -> bool:
        enter_context()
        began = time.perf_counter()
        facts, blocks = self._upload()
        self._upload_seconds = time.perf_counter() - began
        precision, sampler = self._scene.settings.precision, sampler_flags(self._scene)
        self._paths = load("RENDER_PATHS", precision, sampler, self._goes_on)
        self._clocks = StageClocks()
        self._stages = SceneKernels(facts, blocks, self._scene, self._goes_on)
        self._walks = (
            load("RENDER_WALKS", precision, MOVING * facts["moves"] + TIMED * self._timed + sampler, self._goes_on)
            if facts["subsurface"]
            else None
        )
        self._prepare_waves(facts)
        return not self._cancelled

    def _goes_on(self) -> bool:
        """Asked by who waits for the compiler."""
        self.compiling = True
        return not self._cancelled

    def _prepare_waves(self, facts: dict[str, Any]) -> None:
        """The film and the wavefront: those that are there, where they serve."""
        self._most_rounds = int(facts["most_rounds"])
        self._media = facts["media"] and bool(self._stages.plan["VOLUMES"])
        self._transparent = bool(facts["transparent"])
        self._photons = None
        beside = Beside(self._walks is not None, self._media, facts["moves"], self._timed, self._transparent)
        pixels, held = self._scene.film.pixels, self._held
        if held is not None and held.serves(self._arrays.root, beside):
            wanted = self._wanted_paths(pixels)
            if (wanted <= held.held or held.all_that_fits) and held.restart(self._arrays.root, pixels, wanted):
                self._begin_maps(facts)
                return
        if held is not None:
            held = None
            self.rest()  # the free memory is asked for below
        self._held = self._allocate(pixels, max(1, facts["materials"]), beside, facts["photon_maps"])
        self._begin_maps(facts)

    def _begin_maps(self, facts: dict[str, Any]) -> None:
        if facts["photon_maps"] and self._stages.plan["PHOTONS"]:
            self._photons = PhotonMaps(self._memory, self._paths, self._stages, self._tracer, self._most_rounds, facts,
                                       lambda: not self._cancelled)  # fmt: skip

    @staticmethod
    def _paths_that_fill() -> int:
        """At once: with fewer the device is not busy all the time."""
        processors = int(cupy().cuda.Device().attributes["MultiProcessorCount"])
        return min(MOST_PATHS, 1 << max(20, (processors * PATHS_OF_MULTIPROCESSOR).bit_length() - 1))

    def _wanted_paths(self, pixels: int) -> int:
        """At once, were memory no matter."""
        return min(self._paths_that_fill(), pixels * max(1, int(self._scene.settings.samples)))

    @property
    def _memory(self) -> Memory:
        assert self._held is not None, "after prepare() or set_view()"
        return self._held

    def _upload(self) -> tuple[dict[str, Any], Blocks]:
        """The scene and its trees; large ones are built on the device. What decides the scene's kernels."""
        facts, ((blocks, links), (tree_blocks, tree_links), left, depth) = self._host.facts, self._host.images
        left_images = self._images_to_leave(blocks, tree_blocks, left)
        self._arrays = DeviceCopy(blocks, links, left_images)
        self.warnings = _told_images([len(blocks[number][1]) for number in left_images])
        self._tracer = SceneTracer(tree_blocks, tree_links, facts["structure"], self._scene.settings.precision,
                                   facts["world_apart"], left, depth, facts["trees_move"],
                                   self._scene.settings.curve_shape if facts["curves"] else "", self._timed,
                                   self._goes_on)  # fmt: skip
        return facts, blocks

    def _images_to_leave(self, blocks: Blocks, tree_blocks: Blocks, left: Left) -> set[int]:
        """Images for which there is no room beside the rest, by an estimate before anything is allocated."""
        images = sum(len(data) for name, data in blocks if name == PIXELS)
        rest = sum(len(data) for _, data in [*blocks, *tree_blocks]) - images
        rest += sum(len(corners) * TREE_BYTES for corners, _, _ in left)
        free, _ = cupy().cuda.runtime.memGetInfo()
        room = int(free * SCENE_SHARE) - rest
        if room < 0:
            raise too_large(rest)
        budget = self._scene.settings.texture_memory
        return images_to_leave(blocks, min(room, int(budget * 1e6)) if budget > 0 else room)

    def _allocate(self, pixels: int, materials: int, beside: Beside, photons: bool) -> Memory:
        """As large a wavefront as the device's memory allows, up to MOST_PATHS."""
        cp = cupy()
        free, _ = cp.cuda.runtime.memGetInfo()
        if photons:
            free -= min(free // 2, bytes_of_maps(pixels))
        fields, root = core.render.task_fields(), self._arrays.root
        stride = struct.unpack_from("<I", root, fields["film.layout.stride"])[0]
        fits = int((free * MEMORY_SHARE - pixels * (8 * stride + 4)) / bytes_per_path(stride, beside))
        wanted = self._wanted_paths(pixels)
        paths = min(fits, wanted)
        while paths >= min(FEWEST_PATHS, pixels):
            try:
                memory = Memory(root, pixels, materials, paths, beside)
                memory.all_that_fits = paths < wanted
                return memory
            except cp.cuda.memory.OutOfMemoryError:
                cp.get_default_memory_pool().free_all_blocks()
                paths //= 2
        raise DeviceError(
            f"The GPU has {free / 2**30:.1f} GiB free; the film of this picture and {FEWEST_PATHS:,} paths need more. "
            "Close what else uses the GPU, render a smaller picture or fewer passes, or use the CPU."
        )

    def render(self, first: int, count: int) -> bool:
        """Traces samples [first, first + count) of every pixel. False when cancelled; waves are whole or not at all."""
        return self.render_parts([(None, first, count)])

    def render_regions(self, begins: Any, ends: Any) -> bool:
        """Traces samples [begins[r], ends[r]) of region r (luch.adaptive). False when cancelled."""
        return self.render_parts(list(parts(regions_of(self._scene.film), begins, ends)))

    def render_parts(self, work: Sequence[Part]) -> bool:
        """As render(), each for pixels of its own."""
        with self._device:
            return self._render(work)

    def _render(self, work: Sequence[Part]) -> bool:
        enter_context()
        began = self._uncharged = time.perf_counter()
        waves = list(self._waves_of(work))
        charging = self._clocks.charging_seconds
        self._waves_done, self._waves = 0, len(waves)
        for pixels, wave in waves:
            if self._cancelled:
                break
            with self._lock:
                if wave[0] == 0:
                    self._memory.mark(wave[2], pixels)
                if self._photons is not None and not self._photons.serve(wave[2]):
                    break
                self._trace_wave(*wave, pixels)
            self._waves_done += 1
        cupy().cuda.get_current_stream().synchronize()
        charging = self._clocks.charging_seconds - charging
        self._trace_seconds += time.perf_counter() - began - charging
        return not self._cancelled

    def _waves_of(self, work: Sequence[Part]) -> Iterator[tuple[Any, tuple[int, int, int, int]]]:
        """(pixels on the device or None, (first of them, how many, first sample, samples))."""
        memory = self._memory
        for pixels, first, count in work:
            listed = _on_device(pixels)
            total = memory.pixels if listed is None else len(listed)
            for sample, samples in parted(first, count, memory.layers, self._photons is not None):
                for pixel in range(0, total, memory.layer_pixels):
                    yield listed, (pixel, min(memory.layer_pixels, total - pixel), sample, samples)

    def mark(self, sample: int, pixels: Any = None) -> None:
        """Parts this device's samples before that one of all devices from those after it, if it is a power of two."""
        with self._lock, self._device:
            enter_context()
            self._memory.mark(sample, _on_device(pixels))

    def _trace_wave(self, pixel: int, pixels: int, sample: int, samples: int, listed: Any) -> None:
        memory, rays = self._memory, pixels * samples
        self._merged = self._on_host = False
        self._counts["paths"] += rays
        self._launch(
            self._paths.kernel("begin_paths"),
            0,
            rays,
            struct.pack("<4IQ", pixel, pixels, sample, samples, 0 if listed is None else listed.data.ptr),
        )
        if self._media:
            self._launch(self._stages.kernel("enter_media"), 0, rays, self._tracer.root)
        turn, left = 0, self._most_rounds
        while rays and left and not self._abandoned:
            left -= 1
            shadows = self._trace_round(turn, rays)
            self._counts["rays"] += rays
            self._counts["shadow_rays"] += shadows
            turn ^= 1
            rays = memory.count("rays")
        if self._timed:
            those = slice(pixel, pixel + pixels) if listed is None else listed[pixel : pixel + pixels]
            self._clocks.charge(memory, those, pixels, samples, time.perf_counter() - self._uncharged)
            self._uncharged = time.perf_counter()

    def _trace_round(self, turn: int, rays: int) -> int:
        """One event of every path; returns how many shadow rays were cast."""
        memory, paths, stages = self._memory, self._paths, self._stages
        with self._clock("closest"):
            self._tracer.closest_of_wave(memory, turn)
        shadows = 0
        if self._media:
            with self._clock("media"):
                self._launch(stages.kernel("cross_media"), turn, rays)
            shadows += self._cast_shadows(turn)
        with self._clock("light"):
            self._launch(stages.kernel("find_light"), turn, rays)
        memory.sort_hits(paths, turn, rays)
        with self._clock("surfaces"):
            self._launch(stages.kernel("shade_surfaces"), turn, rays)
        if self._walks is not None and (walks := memory.count("walks")):
            shadows += self._cast_shadows(turn)
            kernel = self._walks.kernel("walk_subsurface")
            with self._clock("walks"):
                kernel.launch(min(kernel.resident_blocks(BLOCK), -(-walks // BLOCK)), BLOCK, [memory.tasks[turn]])
                self._launch(self._walks.kernel("probe_profiles"), turn, walks)
            with self._clock("exits"):
                self._launch(stages.kernel("shade_exits"), turn, walks)
        shadows += self._cast_shadows(turn, last=True)
        self._launch(paths.kernel("next_round"), turn, 1)
        return shadows

    def _cast_shadows(self, turn: int, last: bool = False) -> int:
        """Traces the shadow rays so far and adds their light; returns how many there were.

        A path may have one of them waiting that adds to Combined, no more: its film's sums are no atomic ones. So what
        its flight through a medium cast is added before its surface is lit, and that before its exit from below one.
        last: of this round, after which the device clears the counters itself.
        """
        memory = self._memory
        shadows = memory.count("shadows")
        if shadows:
            with self._clock("any"):
                self._tracer.any(memory.address("shadow_rays"), memory.address("shadow_kind"),
                                 memory.address("blocked"), memory.counter("shadows"), memory.counter("shadowed"),
                                 memory.near_movers.data.ptr, memory.address("shadow_time"),
                                 memory.address("shadow_ticks"))  # fmt: skip
            with self._clock("shadows"):
                self._launch(self._stages.kernel("add_shadows"), turn, shadows)
                if self._transparent:
                    self._launch(self._stages.kernel("see_through"), turn, shadows, self._tracer.root)
            if not last:
                memory.clear("shadows", "shadowed", "shadowed_after", "shadows_near_movers", "see_through")
        return shadows

    def _clock(self, stage: str) -> AbstractContextManager[None]:
        return self._clocks.running(stage) if self._timed else nullcontext()

    def _launch(self, kernel: Any, turn: int, threads: int, *more: bytes) -> None:
        self._memory.launch(kernel, turn, threads, *more)

    def cancel(self) -> None:
        """Callable from any thread: render() returns within one wave's time."""
        self._cancelled = True
        self._host.core.cancel()

    def abandon(self) -> None:
        """As cancel(), for a film that nobody will read: within one round's time. Until set_view()."""
        self._abandoned = True
        self.cancel()

    def step_progress(self) -> float:
        """Share of the running step that is done, 0..1."""
        return self._waves_done / self._waves if self._waves else 0.0

    def film(self) -> tuple[Any, Any]:
        """The film's sums (pixels, stride) float64 and samples (pixels,) uint32 so far, on the host."""
        with self._whole_film() as memory:
            return memory.rows[0].get(), memory.counts[0].get()

    @contextmanager
    def _whole_film(self) -> Iterator[Memory]:
        """With all layers of the film in the first."""
        memory = self._memory
        with self._lock, self._device:
            enter_context()
            if not self._merged:
                self._launch(self._paths.kernel("merge_layers"), 0, memory.pixels, struct.pack("<I", memory.layers))
                self._merged = True
            yield memory

    def _download(self) -> None:
        if not self._on_host:
            self._host.set_film(*self.film())
            self._on_host = True

    def passes(self) -> dict[str, Any]:
        """As core.render.Renderer's, read on the device: a few floats a pixel are on their way, not all its sums."""
        if self._held is None:  # nothing was traced
            return super().passes()
        with self._whole_film() as memory:
            return {
                name: self._read(memory, "read_pass", channels, read)
                for name, channels, read in self._host.core.pass_reads()
            }

    def deviations(self) -> tuple[Any, Any, float]:
        """As core.render.Renderer's."""
        if self._held is None or self._memory.field("film.layout.marks") == NONE:
            return super().deviations()  # which says what is wrong
        with self._whole_film() as memory:
            marked = cupy().empty((2, memory.pixels), np.uint32)
            _, _, read = self._host.core.pass_reads()[0]
            both = self._read(memory, "read_deviations", 6, read, struct.pack("<Q", marked.data.ptr))
            before, samples = (int(part) for part in marked.sum(axis=1, dtype=np.uint64).get())
        mean, deviation = both.reshape(2, *both.shape[:2], 3)
        return mean, deviation, before / samples if samples else 0.0

    def _read(self, memory: Memory, kernel: str, channels: int, read: bytes, *more: bytes) -> Any:
        """float32 (H, W, channels), bottom row first."""
        out = cupy().empty(memory.pixels * channels, np.float32)
        self._launch(self._paths.kernel(kernel), 0, memory.pixels, read, struct.pack("<Q", out.data.ptr), *more)
        width, height = self._scene.film.size
        return out.get().reshape(height, width, channels)

    def stats(self) -> dict[str, Any]:
        """Counts, bytes and seconds, under the names of the CPU's."""
        return {**self._host.core.stats(), **self.own_stats()}

    def _shading_kernel(self) -> dict[str, float]:
        """What the dearest stage takes of a multiprocessor."""
        told = self._stages.kernel("shade_surfaces").properties(BLOCK)
        return {name: told[name] for name in ("registers", "local_bytes", "occupancy")} | {
            "code_bytes": self._stages.code_bytes
        }

    def own_stats(self) -> dict[str, Any]:
        """Those of them that are the device's; none before prepare() and after rest()."""
        if self._held is None:
            return {}
        with self._device:
            totals = dict(zip(TOTALS, (int(x) for x in self._memory.totals.get()), strict=True))
            shading = self._shading_kernel()
        totals["non_finite_samples"] = sum(totals[cause] for cause in REFUSALS)
        counts: dict[str, Any] = {**self._counts, **totals}
        counts["shadow_rays"] += counts.pop("transparent_rays")
        if self._photons is not None:
            counts |= self._photons.stats
        return counts | {
            "trace_seconds": self._trace_seconds,
            "upload_seconds": self._upload_seconds,
            "device_scene_bytes": self._arrays.bytes + self._tracer.bytes,
            "device_film_and_paths_bytes": self._memory.bytes,
            "paths_at_once": self._memory.slots,
            "paths_to_fill": self._paths_that_fill(),
            "path_bytes": core.render.task_sizes()["path"],
            "kernel_plan": self._stages.plan,
            "shading_kernel": shading,
            "kernels": "general" if self._stages.general else "the scene's own",
            "kernels_settled": self._stages.settled,
            "general_kernels": self._stages.has_general,  # whether there are such that serve this scene
            "kernel_compile_seconds": self._stages.compile_seconds,
        }

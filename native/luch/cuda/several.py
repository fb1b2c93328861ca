"""Several GPUs of one host render one picture: each takes a part of the samples of every pixel.

A device's part of a step is chosen by what it traced a second before, so that unlike devices end together. Sums are
double: the picture is one device's, but for the order in which they are added.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from luch.adaptive import parts, regions_of
from luch.cuda.device import OLDEST, DeviceError, architecture_of, cupy, require_sound
from luch.cuda.host import HostFilm, HostScene
from luch.cuda.render import DeviceRenderer, parted
from luch.cuda.trace import TreesTooDeep
from luch.ledger import REFUSALS

# Counts and seconds that are added up; of other statistics the first device's stand for all.
SUMMED = ("paths", "rays", "shadow_rays", "surface_points", "non_finite_samples", "clamped_units", "cut_units", "transparent_steps", "world_points",
          "light_points", "device_scene_bytes", "device_film_and_paths_bytes", "paths_at_once", "paths_to_fill", "subsurface_walks", "subsurface_steps", *REFUSALS)  # fmt: skip


def renderer_for(scene: Any) -> Any:
    """DeviceRenderer, or SeveralDevices where the scene's settings allow more than one GPU and there are more.

    Raises DeviceError where there is none, ValueError for data that does not fit together.
    """
    require_sound()
    wanted = scene.settings.gpus
    if wanted < 0:
        raise ValueError(f"Settings: gpus is {wanted}; it can be 0 (all) or how many to use.")
    chosen = usable_devices()[: wanted or None]
    return SeveralDevices(scene, chosen) if len(chosen) > 1 else DeviceRenderer(scene)


def usable_devices() -> list[int]:
    """CUDA's numbers of the devices that can run the kernels. Raises DeviceError where there is none."""
    cp, usable = cupy(), []
    for index in range(cp.cuda.runtime.getDeviceCount()):
        with cp.cuda.Device(index):
            if architecture_of(cp) >= OLDEST:
                usable.append(index)
    return usable


def shares(count: int, weights: list[float]) -> list[int]:
    """How many of `count` samples each gets: in proportion to the weights, every sample given once."""
    total, ends = sum(weights), [0]
    for k in range(len(weights)):
        ends.append(round(count * sum(weights[: k + 1]) / total) if k + 1 < len(weights) else count)
    return [after - before for before, after in itertools.pairwise(ends)]


class SeveralDevices(HostFilm):
    """The methods of ``core.render.Renderer`` that ``luch.render`` uses, on several CUDA devices."""

    def __init__(self, scene: Any, indices: list[int]) -> None:
        """scene: luch.scene.Scene; indices: CUDA's, of at least one device. Raises ValueError as DeviceRenderer."""
        super().__init__(HostScene(scene))
        self._film = scene.film
        self._devices: list[DeviceRenderer] = []
        for index in indices:
            with cupy().cuda.Device(index):
                self._devices.append(DeviceRenderer(scene, self._host))
        self._rates = [1.0] * len(indices)  # samples a second of the last step
        self._merged = True
        self._cancelled = False
        self.warnings: list[str] = []

    @property
    def device(self) -> str:
        """For the statistics: "CUDA: 2 x NVIDIA H200"."""
        names = [device.device.removeprefix("CUDA: ") for device in self._devices]
        kinds = list(dict.fromkeys(names))
        return "CUDA: " + ", ".join(f"{names.count(kind)} x {kind}" for kind in kinds)

    @property
    def compiling(self) -> bool:
        """As DeviceRenderer's, of any device."""
        return any(device.compiling for device in self._devices)

    def prepare(self) -> bool:
        """Builds structures and lights once, uploads them to every device. False when cancelled.

        A device whose memory is too small is left out and named in `warnings`; the last one raises DeviceError.
        """
        if not self._host.prepare():
            return False
        try:
            ready = self._prepare_devices()
        except TreesTooDeep:
            ready = self._host.build_all() and self._prepare_devices()
        self._host.images = None
        return ready

    def _prepare_devices(self) -> bool:
        failures = self._each([device.prepare_device for device in self._devices])
        told = [error for error in failures if error is not None]
        for error in told:
            if isinstance(error, TreesTooDeep) or not isinstance(error, DeviceError):
                raise error
        kept = [device for device, error in zip(self._devices, failures, strict=True) if error is None]
        if not kept:
            raise told[0]
        self.warnings += [f"One GPU of {len(self._devices)} is left out: {error}" for error in told]
        self.warnings += dict.fromkeys(told for device in kept for told in device.warnings)
        self._devices, self._rates = kept, [1.0] * len(kept)
        return not self._cancelled

    def set_view(self, scene: Any) -> bool:
        """As core.render.Renderer's. False: this view needs a renderer of its own."""
        view = self._host.set_view(scene)
        if view is None:
            return False
        self._film, self._merged, self._cancelled = scene.film, True, False
        return all([device.set_device_view(scene, *view) for device in self._devices])

    def rest(self) -> None:
        """As DeviceRenderer's, of every device."""
        for device in self._devices:
            device.rest()

    def origin_reach(self) -> float:
        """As core.render.Renderer's."""
        return self._devices[0].origin_reach()

    def render(self, first: int, count: int) -> bool:
        """Traces samples [first, first + count) of every pixel. False when cancelled."""
        self._merged = False
        return all([self._render_part(None, *part) for part in parted(first, count, count)])

    def render_regions(self, begins: Any, ends: Any) -> bool:
        """Traces samples [begins[r], ends[r]) of region r (luch.adaptive). False when cancelled."""
        self._merged = False
        regions = regions_of(self._film)
        return all(
            [
                self._render_part(pixels, *part)
                for pixels, first, count in parts(regions, begins, ends)
                for part in parted(first, count, count)
            ]
        )

    def _render_part(self, pixels: Any, first: int, count: int) -> bool:
        for device in self._devices:
            device.mark(first, pixels)
        samples = shares(count, self._rates)
        seconds = [0.0] * len(samples)

        def part(k: int, start: int) -> None:
            began = time.perf_counter()
            self._devices[k].render_parts([(pixels, start, samples[k])])
            seconds[k] = time.perf_counter() - began

        starts = [first + sum(samples[:k]) for k in range(len(samples))]
        working = [k for k in range(len(samples)) if samples[k]]
        for error in self._each([partial(part, k, starts[k]) for k in working]):
            if error is not None:
                raise error
        if len(working) == len(samples) and not self._cancelled:
            self._rates = [taken / max(took, 1e-6) for taken, took in zip(samples, seconds, strict=True)]
        return not self._cancelled

    @staticmethod
    def _each(work: list[Callable[[], Any]]) -> list[BaseException | None]:
        """Does all at once, each on a thread of its own, as CUDA's current device is a thread's; errors in order."""
        errors: list[BaseException | None] = [None] * len(work)

        def run(k: int) -> None:
            try:
                work[k]()
            except BaseException as error:  # handed to the caller
                errors[k] = error

        threads = [threading.Thread(target=run, args=(k,), daemon=True) for k in range(len(work))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return errors

    def cancel(self) -> None:
        """Callable from any thread: render() returns within one wave's time."""
        self._cancelled = True
        for device in self._devices:
            device.cancel()

    def abandon(self) -> None:
        """As DeviceRenderer's, of every device."""
        self._cancelled = True
        for device in self._devices:
            device.abandon()

    def step_progress(self) -> float:
        """Share of the running step that is done, 0..1: the slowest device's."""
        return min(device.step_progress() for device in self._devices)

    def _download(self) -> None:
        if self._merged:
            return
        self._merged = True
        rows, counts = self._devices[0].film()
        for device in self._devices[1:]:
            more_rows, more_counts = device.film()
            rows += more_rows
            counts += more_counts
        self._host.set_film(rows, counts)

    def stats(self) -> dict[str, Any]:
        """Counts, bytes and seconds, of all devices together."""
        each = [device.own_stats() for device in self._devices]
        stats: dict[str, Any] = {**self._host.core.stats(), **each[0]}
        stats.update({name: sum(own[name] for own in each) for name in SUMMED if name in each[0]})
        if each[0]:
            stats["kernels_settled"] = all(own["kernels_settled"] for own in each)
        stats["samples_per_second_of_gpus"] = [round(rate, 1) for rate in self._rates]
        return stats

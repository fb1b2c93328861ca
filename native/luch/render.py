"""Renders a scene: the loop over samples, progress, time left, cancelling.

>>> result = render(scene, progress=lambda p: print(p.samples) or True)   # doctest: +SKIP
>>> result.passes["Combined"].shape                                       # doctest: +SKIP
(1080, 1920, 4)
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from luch import accuracy, denoise, door, ledger, memory, pixel_error
from luch._native import core
from luch.adaptive import Adaptive
from luch.check import check_scene
from luch.cuda.device import faults_told
from luch.curve import Curve, Forecast, next_target
from luch.effects.removal import without
from luch.kept import Kept
from luch.merge import Sums
from luch.scene import F32, Film, Scene, Settings
from luch.stopping import CUSTOM, Stopping
from luch.watching import WATCH_SECONDS, watched

# Steps grow until one takes about this long; longer steps show the picture too seldom.
STEP_SECONDS = 4.0
# The error is looked at where that takes at most this share of the time so far: of all time 1 %, as looks lie a third
# to a half apart. Where an error is to end the render it may take more, 4.5 % of all time at the worst: the look that is
# left out costs all samples up to the next one.
LOOK_SHARE, LOOK_SHARE_ASKED = 0.007, 0.03
# Of one processor of 2024, for a pixel: what a look is taken to cost beforehand. Whether there is one must not depend
# on what it took the last time: the first in a process takes ten times as long as those after it.
LOOK_SECONDS = 0.2e-6
CANCEL_LOOK_SECONDS = 0.2  # the longest that who cancels waits for: a look at 3840 x 2160 pixels takes seconds
QUICK_LOOK_SECONDS = 0.02  # taken however short the render, where an error is asked for
# What reading passes takes at the end of a render that may only take so long; seconds a pixel and channel.
PASS_SECONDS = 4e-9


@dataclass(frozen=True)
class Steering:
    """What a caller may ask of a render between two steps, where Progress.new_picture is true."""

    lost: Callable[[], float]  # share of the light that clamping and limits of bounces took so far (luch.ledger)
    leave_out: Callable[[float], None]  # seconds that the caller has spent on something else: not the render's
    ask: Callable[[float], None]  # another error to end by


@dataclass
class Progress:
    """What the caller is told while the picture grows. ``passes`` is only to be called from the callback."""

    samples: int  # finished, of every pixel
    total_samples: int
    fraction: float  # of the whole work, 0..1
    seconds: float  # since rendering began
    remaining_seconds: float  # estimate; inf while nothing is known
    memory_bytes: int  # of the process, at its peak
    new_picture: bool  # a step has ended since the last call: passes() shows more than before
    passes: Callable[[], dict[str, F32]]
    error: float | None = None  # of the picture at the last look, as in luch.accuracy
    asked_error: float = 0.0  # 0: none
    forecast: Forecast | None = None  # of the error asked for, else of the next round one
    curve: Curve | None = None
    preparing: bool = False  # structures and lights are being built; no sample was traced yet
    compiling: bool = False  # what is waited for then is the compiler of a GPU's kernels
    steering: Steering | None = None  # None while preparing

    @property
    def doing_before(self) -> str:
        """What it does while preparing, in words."""
        return "Compiling kernels for this GPU" if self.compiling else "Building structures and lights"


@dataclass(frozen=True)
class Pace:
    """How often a render stops to look, at itself and at its caller."""

    watch_seconds: float = WATCH_SECONDS  # between two questions to the caller
    look_share: float = LOOK_SHARE


@dataclass
class Result:
    """The finished picture: pass name -> float32 (H, W, C), bottom row first; and what it took."""

    passes: dict[str, F32]
    stats: dict[str, Any] = field(default_factory=dict)
    cancelled: bool = False
    sums: Sums | None = None  # for luch.merge, if Settings.mergeable


PACE = Pace()


def preparing(total: int, start: float) -> Progress:
    """What is told before the first sample."""
    seconds = time.perf_counter() - start
    return Progress(0, total, 0.0, seconds, float("inf"), peak_memory_bytes(), False, dict, preparing=True)


def peak_memory_bytes() -> int:
    """Most memory that this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _next_count(done: int, next_look: int, seconds: float) -> int:
    """Samples of the next step: doubling, bounded by what STEP_SECONDS allow and by the next look."""
    if done == 0:
        return 1
    by_time = max(1, int(STEP_SECONDS * done / max(seconds, 1e-6)))
    return max(1, min(done, by_time, next_look - done))


def _adaptive_for(film: Film, settings: Settings) -> Adaptive | None:
    """Only on the way to an error, and where not every pixel must have the same samples."""
    asked = settings.adaptive and settings.error_limit > 0.0
    return Adaptive(film, settings.samples) if asked and not _not_adaptive(settings) else None


def _not_adaptive(settings: Settings) -> list[str]:
    if not (settings.adaptive and settings.error_limit > 0.0):
        return []
    if settings.photon_maps:
        return ["Adaptive Sampling is left out: with photon maps a sample of all pixels shares its photons."]
    if settings.mergeable:
        return ["Adaptive Sampling is left out: pictures that are merged or verified have the same samples everywhere."]
    return []


def _renderer_for(scene: Scene) -> tuple[Any, list[str]]:
    """The device's renderer; where CUDA is asked for and cannot be had, the CPU's and one sentence that says why."""
    memory.require(scene)
    if scene.settings.device == "CPU":
        return core.render.Renderer(scene), []
    if scene.settings.device != "CUDA":
        raise ValueError(f"Settings: device is {scene.settings.device!r}; it can be CPU or CUDA.")
    from luch.cuda import DeviceError
    from luch.cuda.several import renderer_for

    try:
        return renderer_for(scene), []
    except DeviceError as error:
        return core.render.Renderer(scene), [f"Rendered on the CPU: {error}"]


class _Loop:
    """One render while it grows: steps, looks, and what ends it."""

    def __init__(self, renderer: Any, scene: Scene, settings: Settings, progress: Callable[[Progress], bool] | None,
                 start: float, pace: Pace) -> None:  # fmt: skip
        self.renderer, self.settings, self.progress, self.start = renderer, settings, progress, start
        self.pace = pace
        self.curve = Curve(settings.sampler)
        self.stopping = Stopping(max(1, settings.samples), settings.error_limit)
        self.done = 0
        self.adaptive = _adaptive_for(scene.film, settings)
        self.prepared = start
        self.cancelled = self.timed_out = False
        self._left_out = 0.0  # seconds
        self._exposure = scene.film.exposure
        pixels = scene.film.pixels
        self._look_expected = LOOK_SECONDS * pixels / max(1, os.cpu_count() or 1) if settings.estimate_error else 0.0
        self._look_cost = self._look_expected  # of the last one
        self._passes_cost = PASS_SECONDS * pixels * (4 + 3 * len(scene.film.passes))

    @property
    def seconds(self) -> float:
        """Of rendering: since structures and lights were built."""
        return time.perf_counter() - self.prepared - self._left_out

    def _lost(self) -> float:
        found = ledger.shares(self.renderer.stats(), self.renderer.passes()["Combined"], self._exposure)
        return found.get("clamped_share", 0.0) + found.get("cut_share_estimate", 0.0)

    def _leave_out(self, seconds: float) -> None:
        self._left_out += seconds

    def _ask(self, error: float) -> None:
        self.settings = replace(self.settings, error_limit=error)
        self.stopping.ask(error, self.curve)

    def prepare(self) -> None:
        """Structures and lights."""

        def goes_on() -> bool:
            if self.progress is None:
                return True
            compiling = getattr(self.renderer, "compiling", False)  # the CPU has no kernels
            return self.progress(replace(preparing(self.stopping.samples, self.start), compiling=compiling))

        self.cancelled = not watched(
            self.renderer.prepare, self.renderer, goes_on, watch_seconds=self.pace.watch_seconds
        )
        self.prepared = time.perf_counter()

    def seconds_left(self) -> float:
        """For tracing: the last look and the passes come out of the limit too, and so did building."""
        if not self.settings.time_limit > 0.0:
            return float("inf")
        ends = self.start + self.settings.time_limit - self._look_cost - self._passes_cost
        return ends - time.perf_counter()

    def run(self) -> None:
        """Until a limit is reached or the caller says no. There is at least one sample, however short the time."""
        while self.done < self.stopping.samples and not (self.cancelled or self.timed_out or self.stopping.reached):
            self._step(_next_count(self.done, self._next_stop(), self.seconds))
        self.render_seconds = self.seconds
        self._look(last=True)

    def _next_stop(self) -> int:
        """Samples that no step goes beyond."""
        if self.settings.estimate_error:
            return self.stopping.next_look(self.done)
        return min(1 << self.done.bit_length(), self.stopping.samples)

    def _step(self, count: int) -> None:
        first = self.done

        def goes_on() -> bool:
            self.timed_out = first > 0 and self.seconds_left() <= 0.0
            self.cancelled = not self._tell(first, count, False)
            return not (self.cancelled or self.timed_out)

        left = self.seconds_left if first > 0 else lambda: float("inf")
        watched(self._work(count), self.renderer, goes_on, left, self.pace.watch_seconds)
        if self.cancelled or self.timed_out:
            return
        self.done += count
        self.timed_out = self.seconds_left() <= 0.0
        if not self.timed_out:
            self._look(last=False)
        self.cancelled = not self._tell(self.done, 0, True)

    def _work(self, count: int) -> Callable[[], object]:
        """So many samples more, of every pixel or on average."""
        start, adaptive = self.settings.first_sample, self.adaptive
        if adaptive is None:
            return partial(self.renderer.render, start + self.done, count)
        begins, adaptive.counts = adaptive.counts, adaptive.ends(self.done + count)
        if not adaptive.used:
            return partial(self.renderer.render, start + self.done, count)
        return partial(self.renderer.render_regions, start + begins, start + adaptive.counts)

    def _look(self, last: bool) -> None:
        """A point of the curve: where the rule of stopping wants one and it costs next to nothing, and at the end."""
        if last and self.cancelled and self._look_cost > CANCEL_LOOK_SECONDS:
            return
        points = self.curve.points
        seen = bool(points) and points[-1][0] == self.done
        if last and seen and (self.cancelled or self.timed_out):
            points.pop()  # the film may hold more since: parts of a step that was cut off
        elif seen:
            return
        due = self.done == self.stopping.next_look(self.done - 1)
        # Where samples go must not depend on how fast the machine is.
        due = due and (self._look_expected <= self._look_allowed or self.adaptive is not None)
        asked = self.done == self.stopping.settled
        if not self.settings.estimate_error or not (last or due or asked):
            return
        began = time.perf_counter()
        mean, deviation, share = self.renderer.deviations()
        found = accuracy.estimate(mean, deviation, share)
        self._look_cost = time.perf_counter() - began
        if found is not None:
            self.curve.add(self.done, self.seconds, found, share)
            if not self.stopping.look(self.curve) and self.adaptive is not None:
                self.adaptive.decide(mean, deviation, share, self.done)

    @property
    def _look_allowed(self) -> float:
        """Seconds that a look may take now."""
        if self.settings.error_limit > 0.0:
            return max(max(self.pace.look_share, LOOK_SHARE_ASKED) * self.seconds, QUICK_LOOK_SECONDS)
        return self.pace.look_share * self.seconds

    def _fraction(self, samples: float) -> float:
        """Of the whole work: whichever end is nearer."""
        fraction = samples / self.stopping.samples
        if self.settings.time_limit > 0.0:
            fraction = max(fraction, (time.perf_counter() - self.start) / self.settings.time_limit)
        if self.settings.error_limit > 0.0 and self.curve.points:
            whole = self.curve.points[-1][0] + self.curve.forecast(self.settings.error_limit).samples
            fraction = max(fraction, samples / max(whole, samples))
        return min(fraction, 1.0)

    def _tell(self, first: int, count: int, new_picture: bool) -> bool:
        if self.progress is None:
            return True
        seconds = self.seconds
        fraction = self._fraction(first + count * (0.0 if new_picture else self.renderer.step_progress()))
        remaining = seconds * (1.0 - fraction) / fraction if fraction > 0.0 else float("inf")
        found = self.curve.last
        aim = self.settings.error_limit or (next_target(found.error) if found and found.error > 0.0 else 0.0)
        return self.progress(
            Progress(
                first,
                self.stopping.samples,
                fraction,
                seconds,
                max(remaining, 0.0),
                peak_memory_bytes(),
                new_picture,
                self.renderer.passes,
                error=found.error if found else None,
                asked_error=self.settings.error_limit,
                forecast=self.curve.forecast(aim) if found else None,
                curve=self.curve,
                steering=Steering(self._lost, self._leave_out, self._ask),  # kept by nobody: it holds this
            )
        )

    def stopped_by(self) -> str:
        """ "cancel", "error", "time" or "samples"."""
        if self.cancelled:
            return "cancel"
        return "error" if self.stopping.reached else "time" if self.timed_out else "samples"


def render(scene: Scene, *, progress: Callable[[Progress], bool] | None = None, pace: Pace = PACE,
           kept: Kept | None = None) -> Result:  # fmt: skip
    """Renders ``scene`` as its settings say, until its samples, its time limit or the error asked for are reached.

    progress is called as pace says (by luch.quality, denoise and verify as by default, ten times a second) and at the end of every
    step; returning False cancels, and the film so far is returned (``Result.cancelled``); what it raises ends the
    render at once and comes out of here. kept: what the last render with it has built is used where that serves, and
    left there for the next one (not by luch.quality, denoise and verify). Raises ValueError for a scene that does not
    fit together, naming the object, MemoryError with the bytes it would take where there are fewer,
    luch.cuda.DeviceError for a GPU that fails while it renders.
    """
    if scene.settings.quality != CUSTOM:
        from luch import quality

        return quality.rendered(scene, render, progress)
    if denoise.NOISY_PASS in scene.film.passes:
        return denoise.beside(scene, render, progress)
    if scene.settings.denoise:
        return denoise.rendered(scene, render, progress)
    if scene.settings.verify:
        from luch.verify import render_verified

        return render_verified(scene, progress=progress)
    start = time.perf_counter()
    check_scene(scene)
    whole, scene = scene, without(scene, scene.settings.without_effects)
    wanted = pixel_error.wanted(scene.film)
    own = [name for name in scene.film.passes if name not in wanted]
    settings = scene.settings
    if wanted or settings.error_limit > 0.0 or settings.mergeable:
        settings = replace(settings, estimate_error=True)
    traced = replace(scene, film=replace(scene.film, passes=own), settings=settings)
    kept = kept or Kept()
    with memory.explained(traced), faults_told():
        prepared = kept.renderer_for(whole, traced, _renderer_for)
        renderer, warnings, traced = prepared.renderer, prepared.warnings, prepared.scene
        pixel_bytes = renderer.stats()["film_pixel_bytes"] + memory.READ_PIXEL_BYTES
        memory.require(traced, pixel_bytes, prepared.reused)
        loop = _Loop(renderer, scene, settings, progress, start, pace)
        loop.prepared = time.perf_counter()
        if not prepared.reused:
            loop.prepare()
        if not loop.cancelled:
            kept.keep(whole, prepared)
        loop.run()
        passes = {name: np.asarray(image) for name, image in renderer.passes().items()}
    stats = dict(renderer.stats())
    stats.update(
        samples=loop.done,
        samples_asked=loop.stopping.samples,
        first_sample=settings.first_sample,
        error_asked=loop.settings.error_limit,
        time_asked=settings.time_limit,
        prepare_seconds=loop.prepared - start,
        reused=prepared.reused,  # what earlier renders had built
        render_seconds=loop.render_seconds,
        seed=settings.seed,
        sampler=settings.sampler,
        device=getattr(renderer, "device", "CPU"),
        instruction_set=core.__name__.rsplit("_", 1)[-1],
        peak_memory_bytes=peak_memory_bytes(),
        cancelled=loop.cancelled,
        stopped_by=loop.stopped_by(),
        warnings=[
            *scene.warnings,
            *_not_adaptive(settings),
            *warnings,
            *door.warnings(stats, scene),
            *getattr(renderer, "warnings", []),
        ],
        geometry_report=door.report(stats, scene),
        effects=prepared.effects,
    )
    if loop.adaptive is not None:
        stats.update(loop.adaptive.statistics(renderer.film_arrays()[1]))
    stats.update(ledger.shares(stats, passes["Combined"], scene.film.exposure))
    stats.update(loop.curve.statistics())
    if wanted:
        _, deviation, share = renderer.deviations()
        passes |= pixel_error.passes_of(wanted, deviation, share, loop.curve.rate()[0])
    stats["total_seconds"] = time.perf_counter() - start
    sums = None
    if settings.mergeable:
        rows, counts = renderer.film_arrays()
        sums = Sums(traced.film, traced.origin, np.array(rows), np.array(counts), settings.seed, settings.first_sample,
                    loop.done, loop.curve.rate(), sampler=settings.sampler)  # fmt: skip
    return Result(passes, stats, loop.cancelled, sums)

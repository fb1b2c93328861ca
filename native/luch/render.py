"""Renders a scene: the loop over samples, progress, time left, cancelling.

>>> result = render(scene, progress=lambda p: print(p.samples) or True)   # doctest: +SKIP
>>> result.passes["Combined"].shape                                       # doctest: +SKIP
(1080, 1920, 4)
"""

from __future__ import annotations

import resource
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from luch import accuracy
from luch._native import core
from luch.effects import effects_of
from luch.effects.removal import without
from luch.scene import F32, Film, Scene

# A step is watched this often: what a cancel waits for at most, beside one batch of paths.
WATCH_SECONDS = 0.1
# Steps grow until one takes about this long; longer steps show the picture too seldom.
STEP_SECONDS = 4.0
# The error is looked at from so many samples on, where that takes at most this share of the time so far. A look
# takes about so many seconds a pixel (one processor of 2024).
FIRST_LOOK = 8
LOOK_SHARE = 0.01
LOOK_SECONDS = 1.2e-6
# The standard error of Combined, (H, W, 3), in its unit.
ERROR_PASS = "Error"
# Where fewer than two samples tell nothing: files and compositors bear no infinity well.
UNKNOWN_ERROR = np.float32(1e10)


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
    preparing: bool = False  # structures and lights are being built; no sample was traced yet


@dataclass
class Result:
    """The finished picture: pass name -> float32 (H, W, C), bottom row first; and what it took."""

    passes: dict[str, F32]
    stats: dict[str, Any] = field(default_factory=dict)
    cancelled: bool = False


def _preparing(total: int, start: float) -> Progress:
    seconds = time.perf_counter() - start
    return Progress(0, total, 0.0, seconds, float("inf"), peak_memory_bytes(), False, dict, preparing=True)


def peak_memory_bytes() -> int:
    """Most memory that this process has held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class _Work(threading.Thread):
    """One call of the native renderer, so that the caller's thread can watch and cancel."""

    def __init__(self, work: Callable[[], object]) -> None:
        super().__init__(daemon=True)
        self._work = work
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self._work()
        except BaseException as error:  # handed to the caller's thread, which raises it
            self.error = error


def _watched(work: Callable[[], object], renderer: Any, goes_on: Callable[[], bool]) -> bool:
    """Does `work` on a thread of its own and asks `goes_on` meanwhile; on the first no, cancels the renderer.

    Returns whether it ran to its end uncancelled. No thread outlives this call.
    """
    thread = _Work(work)
    asked_to_go_on = True
    thread.start()
    try:
        while thread.is_alive():
            thread.join(WATCH_SECONDS)
            if thread.is_alive() and asked_to_go_on and not goes_on():
                asked_to_go_on = False
                renderer.cancel()
    except BaseException:  # Ctrl-C, or the caller's own
        renderer.cancel()
        thread.join()
        raise
    if thread.error is not None:
        raise thread.error
    return asked_to_go_on


def _next_count(done: int, total: int, seconds: float) -> int:
    """Samples of the next step: doubling, bounded by what STEP_SECONDS allow and by what is left."""
    if done == 0:
        return 1
    by_time = max(1, int(STEP_SECONDS * done / max(seconds, 1e-6)))
    return max(1, min(done, by_time, total - done))


def film_pixels(film: Film) -> int:
    """Pixels of the rendered region."""
    x0, y0, x1, y1 = film.border or (0, 0, film.width, film.height)
    return (x1 - x0) * (y1 - y0)


def _told_by(curve: accuracy.Curve) -> dict[str, Any]:
    """Statistics of the error; none where nothing is known."""
    if not curve.points:
        return {}
    found = curve.points[-1][2]
    told: dict[str, Any] = dict(found.statistics())
    told["error_curve"] = [[samples, round(seconds, 3), point.error] for samples, seconds, point in curve.points]
    told["error_rate"] = curve.rate()
    if found.error > 0.0:
        told["next_error"] = accuracy.next_target(found.error)
        told["seconds_to_next_error"] = curve.seconds_to(told["next_error"])
    return told


def _renderer_for(scene: Scene) -> tuple[Any, list[str]]:
    """The device's renderer; where CUDA is asked for and cannot be had, the CPU's and one sentence that says why."""
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


def render(scene: Scene, *, progress: Callable[[Progress], bool] | None = None) -> Result:
    """Renders ``scene`` as its settings say, until its samples or its time limit are reached.

    progress is called about ten times a second and at the end of every step; returning False cancels,
    and the film so far is returned (``Result.cancelled``). Raises ValueError for a scene that does not
    fit together, naming the object.
    """
    start = time.perf_counter()
    effects = effects_of(scene).as_dict()
    scene = without(scene, scene.settings.without_effects)
    wants_error = ERROR_PASS in scene.film.passes and ERROR_PASS not in (name for name, _ in scene.film.aovs)
    settings = replace(scene.settings, estimate_error=scene.settings.estimate_error or wants_error)
    film = replace(scene.film, passes=[name for name in scene.film.passes if name != ERROR_PASS])
    traced = replace(scene, film=film, settings=settings)
    renderer, warnings = _renderer_for(traced)
    total = max(1, settings.samples)
    cancelled = not _watched(renderer.prepare, renderer, lambda: progress is None or progress(_preparing(total, start)))
    prepared = time.perf_counter()
    done = 0

    def tell(first: int, count: int, new_picture: bool) -> bool:
        if progress is None:
            return True
        seconds = time.perf_counter() - prepared
        work = first + count * (0.0 if new_picture else renderer.step_progress())
        fraction = work / total
        if settings.time_limit > 0.0:
            fraction = max(fraction, seconds / settings.time_limit)
        remaining = seconds * (1.0 - fraction) / fraction if fraction > 0.0 else float("inf")
        return progress(
            Progress(
                first,
                total,
                min(fraction, 1.0),
                seconds,
                max(remaining, 0.0),
                peak_memory_bytes(),
                new_picture,
                renderer.passes,
                error=curve.points[-1][2].error if curve.points else None,
            )
        )

    def out_of_time() -> bool:
        return settings.time_limit > 0.0 and time.perf_counter() - prepared >= settings.time_limit

    curve = accuracy.Curve()

    def look(last: bool) -> None:
        """A point of the curve: at every doubling of the samples, where it costs next to nothing, and at the end."""
        seconds = time.perf_counter() - prepared
        due = done >= 2 * curve.points[-1][0] if curve.points else done >= FIRST_LOOK
        cheap = LOOK_SECONDS * film_pixels(scene.film) <= LOOK_SHARE * seconds
        seen = bool(curve.points) and curve.points[-1][0] == done
        if last and seen and done < total:
            curve.points.pop()  # the film holds more since: parts of a step that was cut off
        elif seen:
            return
        if settings.estimate_error and (last or (due and cheap)):
            found = accuracy.estimate(*renderer.deviations())
            if found is not None:
                curve.add(done, seconds, found)

    timed_out = False
    while done < total and not cancelled and not timed_out:
        count = _next_count(done, total, time.perf_counter() - prepared)

        def goes_on(first: int = done, count: int = count) -> bool:
            nonlocal cancelled, timed_out
            timed_out = out_of_time() and first > 0
            cancelled = not tell(first, count, False)
            return not (cancelled or timed_out)

        _watched(partial(renderer.render, done, count), renderer, goes_on)
        if not cancelled and not timed_out:
            done += count
            timed_out = out_of_time()
            look(False)
            cancelled = not tell(done, 0, True)
    render_seconds = time.perf_counter() - prepared
    look(True)
    stats = dict(renderer.stats())
    stats.update(
        samples=done,
        samples_asked=total,
        prepare_seconds=prepared - start,
        render_seconds=render_seconds,
        seed=settings.seed,
        device=getattr(renderer, "device", "CPU"),
        instruction_set=core.__name__.rsplit("_", 1)[-1],
        peak_memory_bytes=peak_memory_bytes(),
        cancelled=cancelled,
        stopped_by="cancel" if cancelled else "time" if timed_out else "samples",
        warnings=[*scene.warnings, *warnings, *getattr(renderer, "warnings", [])],
        effects=effects,
    )
    passes = {name: np.asarray(image) for name, image in renderer.passes().items()}
    stats.update(_told_by(curve))
    if wants_error:
        error = accuracy.standard_error(renderer.deviations()[1])
        passes[ERROR_PASS] = np.where(np.isfinite(error), error, UNKNOWN_ERROR)
    return Result(passes, stats, cancelled)

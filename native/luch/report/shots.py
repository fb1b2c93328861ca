"""One small render of a report: its pictures at growing numbers of samples, and what it took."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from luch import denoise
from luch.kept import Kept
from luch.pixel_error import wanted
from luch.render import Progress, render
from luch.scene import F32, Scene
from luch.stopping import CUSTOM

GoesOn = Callable[[], bool]
FIRST_KEPT = 2  # samples; a single one says nothing of the rate


class NotReady(Exception):
    """Its kernels are still being compiled; who comes later finds them."""


@dataclass
class Shot:
    """pictures: number of samples -> Combined's colour, (H, W, 3); filtered: the same denoised."""

    pictures: dict[int, F32] = field(default_factory=dict)
    filtered: dict[int, F32] = field(default_factory=dict)
    build_seconds: float = 0.0  # 0 where what earlier renders have built serves
    trace_seconds: float = 0.0  # of a clock on the wall
    trace_cpu_seconds: float = 0.0  # of all threads of this process
    stats: dict[str, Any] = field(default_factory=dict)

    @property
    def settled(self) -> bool:
        """Whether its times are those of the kernels that it would have in the end. A CPU has no others."""
        return bool(self.stats.get("kernels_settled", True))

    @property
    def paths_to_fill(self) -> int:
        """How many paths at once keep a GPU busy; 0 on a CPU."""
        return int(self.stats.get("paths_to_fill", 0))

    @property
    def last(self) -> F32:
        return self.pictures[max(self.pictures)]


def scaled(scene: Scene, longest: int, *, enlarged: bool = False) -> Scene:
    """The scene's picture with that many pixels along its longer side, or its own if that is smaller and not to be
    enlarged; whole samples alone end its renders, and they keep no marks."""
    film = scene.film
    factor = longest / max(film.width, film.height)
    if not enlarged:
        factor = min(1.0, factor)
    border = film.border
    if border is not None:
        x0, y0, x1, y1 = (round(edge * factor) for edge in border)
        border = (x0, y0, max(x1, x0 + 1), max(y1, y0 + 1))
    small = replace(film, width=max(1, round(film.width * factor)), height=max(1, round(film.height * factor)),
                    border=border, passes=[name for name in film.passes if name not in wanted(film)])  # fmt: skip
    settings = replace(scene.settings, quality=CUSTOM, denoise=False, time_limit=0.0, error_limit=0.0,
                       estimate_error=False, verify=False, mergeable=False, first_sample=0, samples_in_all=0)  # fmt: skip
    return replace(scene, film=small, settings=settings)


def shoot(scene: Scene, seed: int, samples: int, goes_on: GoesOn, *, denoised: bool = False,
          kept: Kept | None = None, waits: bool = True) -> Shot | None:  # fmt: skip
    """Renders `scaled` scenes; pictures are kept at powers of two and at the end. None where `goes_on` said no; it is
    asked about ten times a second. kept: as luch.render.render has it. waits: for a compiler; NotReady otherwise."""
    not_ready = False
    shot, shown = Shot(), {samples, *(1 << k for k in range(20) if FIRST_KEPT <= 1 << k < samples)}
    clock = _Clock()

    def watch(progress: Progress) -> bool:
        nonlocal not_ready
        if progress.compiling and not waits:
            not_ready = True
            return False
        if progress.new_picture:
            with clock.stopped(progress.samples):
                if progress.samples in shown:
                    passes = progress.passes()
                    shot.pictures[progress.samples] = passes["Combined"][..., :3].copy()
                    if denoised:
                        shot.filtered[progress.samples] = _filtered(passes)
        return goes_on()

    settings = replace(scene.settings, seed=seed, samples=max(2, samples))
    result = render(replace(scene, settings=settings), progress=watch, kept=kept)
    if not_ready:
        raise NotReady
    if result.cancelled:
        return None
    shot.stats = result.stats
    shot.build_seconds = 0.0 if result.stats["reused"] else result.stats["prepare_seconds"]
    shot.trace_seconds, shot.trace_cpu_seconds = clock.all_samples(late=shot.paths_to_fill > 0)
    return shot


class _Clock:
    """Seconds of tracing, on the wall and of the processors, as the steps after the first one took: what a render does
    before and after is not in them, nor what the looks in between take."""

    def __init__(self) -> None:
        self._ends: list[tuple[int, float, float]] = []  # samples, when they were traced
        self._aside = [0.0, 0.0]

    @contextlib.contextmanager
    def stopped(self, samples: int) -> Iterator[None]:
        """While a picture of so many samples is looked at."""
        wall, cpu = time.perf_counter(), time.process_time()
        self._ends.append((samples, wall - self._aside[0], cpu - self._aside[1]))
        yield
        self._aside[0] += time.perf_counter() - wall
        self._aside[1] += time.process_time() - cpu

    def all_samples(self, late: bool) -> tuple[float, float]:
        """late: by the last step alone. A GPU is idle half of the time in the steps before, which are too small."""
        last = self._ends[-1]
        first = self._ends[max(0, len(self._ends) - 2) if late else 0]
        share = last[0] / max(1, last[0] - first[0])
        return max(1e-6, share * (last[1] - first[1])), max(1e-6, share * (last[2] - first[2]))


def _filtered(passes: dict[str, F32]) -> F32:
    aside = (passes.get(denoise.ALBEDO_PASS), passes.get(denoise.NORMAL_PASS))
    return denoise.denoise(passes["Combined"][..., :3], *aside)

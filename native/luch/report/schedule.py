"""A report within a time: what is rendered when, until the seconds that the user gives are used up.

First a pilot tells how fast the scene renders, and by that how large the small picture may be. Then comes the
reference, in two halves of other seeds, and then rounds: in each every way to render takes one render with the round's
seed, the scene as it is set again and again between them, so that what a busy machine does to the time hits all alike.
Two rounds are the least that tells bias from noise. What does not fit into two is left out, the least telling first.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from luch import denoise
from luch.accuracy import NORMAL_95
from luch.effects import effects_of
from luch.identity import identity_of
from luch.kept import Kept, room_for_both
from luch.report.plan import AS_SET, EXACT, Plan, Variant, plan
from luch.report.results import Point, Report, Row
from luch.report.shots import GoesOn, NotReady, Shot, scaled, shoot
from luch.report.tally import (
    Tally,
    brightness_of,
    fit_errors,
    fit_noise,
    floor_of,
    noise_of,
    relative_error,
    weights,
)
from luch.scene import Scene

PILOT_SIZE, PILOT_SAMPLES = 48, 4  # pixels along the longer side
PILOT_SECONDS, PILOT_GROWTH = 0.1, 8
LEAST_SIZE, MOST_SIZE = 32, 320  # pixels along the longer side
LEAST_SAMPLES, MOST_SAMPLES = 8, 256
# A GPU's renders have so many times the paths that keep it busy: their last step, half of the samples, is what is
# timed. In smaller ones that is the length of one path's way: an H100 was taken to need ten times what it does.
TIMES_FULL, MOST_SAMPLES_OF_GPU = 1.5, 4096
LEAST_ROUNDS, GOOD_ROUNDS, MOST_ROUNDS = 2, 4, 16
REFERENCE_SHARE = 0.25  # of the time
MOST_OVER = 64  # of the samples of the others: a half of the reference needs no more
WRITING_SECONDS = 1.0  # kept for statistics and files
WRITING_SHARE = 0.04
LEAST_SECONDS_TO_FILTER = 3.0  # of a report: loading the filter and timing it take half a second
ANCHOR_EVERY = 6  # renders, between two of the scene as it is set
AVERAGE_COST = 1.3  # of all ways to render, over the scene as it is set
REFERENCE_SEEDS = (0x5EED0001, 0x5EED0002)
FIRST_SEED = 1000


@dataclass(frozen=True)
class Told:
    """Progress of a report."""

    doing: str
    fraction: float
    seconds: float
    remaining_seconds: float


Watch = Callable[[Told], bool]


class _Time(NamedTuple):
    """Of one render. settled: of kernels that it would have in the end, as luch.report.shots.Shot has it."""

    seconds: float
    settled: bool


@dataclass
class _Found:
    """What is known of one variant so far."""

    variant: Variant
    tallies: dict[int, Tally] = field(default_factory=dict)  # by samples
    errors: dict[int, list[float]] = field(default_factory=dict)  # relMSE against the reference, by samples
    differences: Tally = field(default_factory=Tally)
    build: list[float] = field(default_factory=list)
    # Seconds, and ratios to those of the scene as it is set; by whether the kernels were those that it would have.
    timed: dict[bool, list[float]] = field(default_factory=dict)
    compared: dict[bool, list[float]] = field(default_factory=dict)

    @property
    def trace(self) -> list[float]:
        return self.timed.get(True) or self.timed[False]

    @property
    def ratios(self) -> list[float]:
        """An effect's price is that of its code, too: code that holds all effects does not tell it."""
        return self.compared.get(True) or ([] if self.variant.effect else self.compared.get(False, []))

    def compare(self, cost: _Time, before: _Time, after: _Time, share: float = 0.5) -> None:
        """With renders of the scene as it is set before and after, as far as their kernels are alike."""
        alike = [(w, one.seconds) for w, one in ((1.0 - share, before), (share, after)) if one.settled == cost.settled]
        if alike:
            own = sum(w * seconds for w, seconds in alike) / sum(w for w, _ in alike)
            self.compared.setdefault(cost.settled, []).append(cost.seconds / own)


class Cancelled(Exception):
    """The user wants no more, or the time is over."""


class Session:
    """One report while it is made. only: which variants. size, samples: of the small
    pictures, 0: as the time allows. rounds: at most. patience: it is planned for its seconds, and
    may take so many times as long where the machine turns out slower. kept: what earlier renders of the scene have built."""

    def __init__(self, scene: Scene, seconds: float, watch: Watch | None, only: Callable[[Variant], bool] | None = None,
                 *, size: int = 0, samples: int = 0, rounds: int = MOST_ROUNDS, patience: float = 1.0,
                 kept: Kept | None = None) -> None:  # fmt: skip
        if not seconds > 0.0:
            raise ValueError(f"A report needs time: {seconds:g} seconds were given.")
        self.scene, self.seconds, self._watch, self._only, self._size = scene, seconds, watch, only, size
        self._rounds, self._patience, self._asked_samples = rounds, patience, samples
        self.start = time.perf_counter()
        self.cancelled = False
        self._doing = "pilot"
        self._denoise_seconds = 0.0
        self._ratio_spread = 0.0  # of the logarithm of one ratio of times, over all variants
        self._unmeasured: list[str] = []
        # Most variants differ in what is decided while paths are traced: they share what is built.
        self._kept = (kept or Kept()) if room_for_both(scene) else None
        self._built_seconds = 0.0  # of what is shared
        self._wide_margin = WRITING_SECONDS if seconds > 10.0 * WRITING_SECONDS else WRITING_SHARE * seconds

    # -- time -------------------------------------------------------------------------------------

    @property
    def spent(self) -> float:
        return time.perf_counter() - self.start

    @property
    def left(self) -> float:
        """For rendering."""
        return self.seconds - self._wide_margin - self.spent

    def _goes_on(self) -> bool:
        if self.left + (self._patience - 1.0) * self.seconds <= 0.0:
            return False
        if self._watch is not None and not self._watch(
            Told(self._doing, min(1.0, self.spent / self.seconds), self.spent, max(0.0, self.seconds - self.spent))
        ):
            self.cancelled = True
        return not self.cancelled

    def _shoot(self, doing: str, scene: Scene, seed: int, samples: int, *, denoised: bool = False,
               goes_on: GoesOn | None = None, waits: bool = True) -> Shot:  # fmt: skip
        """Its build_seconds: where it shares what this session has built, what that took. waits: as shoot has it."""
        self._doing = doing
        shares = self._shares(scene)
        kept = self._kept if shares else None
        goes_on = goes_on or self._goes_on
        shot = None
        if self._goes_on():
            shot = shoot(scene, seed, samples, goes_on, denoised=denoised, kept=kept, waits=waits)
        if shot is None:
            raise Cancelled
        if shares:
            self._built_seconds = shot.build_seconds = shot.build_seconds or self._built_seconds
        return shot

    def _shares(self, scene: Scene) -> bool:
        return self._kept is not None and self._kept.serves(scene)

    def _build_expected(self, shot: Shot) -> float:
        """Seconds that a variant's render takes to build, on the mean over all. shot: of the scene as it is set."""
        anew = sum(not self._shares(variant.of(self.scene)) for variant in self._variants)
        return shot.build_seconds * anew / len(self._variants)

    # -- the story --------------------------------------------------------------------------------

    def run(self) -> Report:
        """Raises Cancelled where not even one way to render could be measured."""
        self._fly_pilot()
        self._render_reference()
        self._found = [_Found(variant) for variant in self._variants]
        rounds = 0
        try:
            while rounds < self._rounds:
                self._render_round(rounds)
                rounds += 1
        except Cancelled:
            pass
        return self._results()

    def _fly_pilot(self) -> None:
        """How fast it goes, and what follows: size, samples, which variants fit."""
        small = scaled(self.scene, PILOT_SIZE)
        samples = PILOT_SAMPLES
        shot = self._shoot("pilot", small, FIRST_SEED, samples)
        too_short = shot.trace_seconds < min(PILOT_SECONDS, 0.02 * self.seconds)
        if shot.paths_to_fill or too_short:  # to tell; and now it is warm
            filling = TIMES_FULL * shot.paths_to_fill / small.film.pixels
            samples = 1 << math.ceil(math.log2(filling)) if shot.paths_to_fill else PILOT_GROWTH * samples
            shot = self._shoot("pilot", small, FIRST_SEED, samples)
        self._least_paths = TIMES_FULL * shot.paths_to_fill
        stats = shot.stats
        self._warnings = list(stats.get("warnings", []))
        self._device = stats["device"]
        self._plan: Plan = plan(self.scene, effects_of(self.scene), stats.get("accelerator", ""),
                                int(stats.get("triangles", 0)), bool(stats.get("general_kernels")))  # fmt: skip
        self._variants = [v for v in self._plan.variants if self._only is None or self._only(v)]
        pace = shot.trace_seconds / (small.film.pixels * samples)  # a path
        self._unmeasured = []
        if self.seconds < LEAST_SECONDS_TO_FILTER:
            self._leave_out(lambda variant: variant.denoised)
        self._filters = any(variant.denoised for variant in self._variants)
        if self._filters:
            self._doing = "denoising, for the time"
            self._denoise_seconds = denoise.seconds_for(self.scene.film.pixels)
        if not self._goes_on():
            raise Cancelled
        build = self._build_expected(shot)
        self._choose_size(pace, build)
        self._drop_what_does_not_fit(pace, build)

    def _choose_size(self, pace: float, build: float) -> None:
        """The picture grows with the time; samples grow when it is large enough."""
        width, height = self.scene.film.size
        renders = GOOD_ROUNDS * len(self._variants) * (1.0 + 1.0 / ANCHOR_EVERY)
        tracing = max(0.05 * self.seconds, (1.0 - REFERENCE_SHARE) * self.left - renders * build)
        paths = max(self._least_paths, tracing / (renders * AVERAGE_COST * pace))
        most = MOST_SAMPLES_OF_GPU if self._least_paths else MOST_SAMPLES
        samples = 16 if paths > 16 * LEAST_SIZE**2 else LEAST_SAMPLES
        longest = self._size or math.sqrt(paths / samples * max(width, height) / min(width, height))
        longest = int(min(max(longest, LEAST_SIZE), max(MOST_SIZE, self._size), max(width, height)))
        self._small = scaled(self.scene, longest)
        pixels = self._small.film.pixels
        while samples < most and (2 * samples * pixels < paths or samples * pixels < self._least_paths):
            samples *= 2
        self._samples = self._asked_samples or samples

    def _drop_what_does_not_fit(self, pace: float, build: float) -> None:
        each = build + AVERAGE_COST * pace * self._small.film.pixels * self._samples
        fits = int((1.0 - REFERENCE_SHARE) * self.left / (LEAST_ROUNDS * each * (1.0 + 1.0 / ANCHOR_EVERY)))
        kept = [variant.name for variant in self._variants[: max(2, fits)]]
        self._leave_out(lambda variant: variant.name not in kept)

    def _leave_out(self, which: Callable[[Variant], bool]) -> None:
        """For want of time."""
        self._unmeasured += [variant.name for variant in self._variants if which(variant)]
        self._variants = [variant for variant in self._variants if not which(variant)]

    def _render_reference(self) -> None:
        """Two halves, whose difference says how far it is converged itself."""
        exact = replace(self._plan.variants[0], denoised=self._filters).of(self._small)
        until = self.spent + REFERENCE_SHARE * self.left
        first = self._shoot("reference", exact, REFERENCE_SEEDS[0], self._samples)
        each = max(first.trace_seconds / self._samples, 1e-6)
        build = 0.0 if self._shares(exact) else first.build_seconds
        wanted = (until - self.spent - 2.0 * build) / (2.0 * each)
        done = max(2 * self._samples, 1 << int(math.log2(max(2.0, min(wanted, MOST_OVER * self._samples)))))
        shots = [self._shoot("reference", exact, seed, done, denoised=self._filters) for seed in REFERENCE_SEEDS]
        halves = [shot.last.astype(np.float64) for shot in shots]
        self._truth = 0.5 * (halves[0] + halves[1])
        self._weight = weights(self._truth)
        self._truth_relmse = float(np.mean((0.5 * (halves[0] - halves[1])) ** 2 * self._weight))
        self._reference_samples = 2 * done
        self._filtered_errors: dict[int, float] = {}
        for samples in shots[0].filtered:
            # Each against the other half, which has twice the noise of both together.
            found = [relative_error(shots[k].filtered[samples], halves[1 - k], self._weight)
                     for k in (0, 1) if samples in shots[k].filtered]  # fmt: skip
            self._filtered_errors[samples] = float(np.mean(found)) - 2.0 * self._truth_relmse

    def _render_round(self, number: int) -> None:
        """Every variant with one seed; the scene as it is set again between them, for the time alone."""
        seed = FIRST_SEED + 1 + number
        base_scene = self._plan.base.of(self._small)
        pictures: dict[str, Any] = {}
        anchor: _Time | None = None
        since = 0
        waiting: list[tuple[_Found, _Time]] = []
        spare = (self._patience - 1.0) * self.seconds
        half = 0.5 * (self.left + spare)
        for found in list(self._found):
            if (
                number == 0 and found is not self._found[0] and self.left + spare < half
            ):  # slower than the pilot foretold
                rest = self._found[self._found.index(found) :]
                self._unmeasured = [*(late.variant.name for late in rest), *self._unmeasured]
                self._found = self._found[: -len(rest)]
                break
            variant = found.variant
            name = f"round {number + 1}: {variant.name}"
            try:
                shot = self._shoot(name, variant.of(self._small), seed, self._samples, denoised=variant.denoised,
                                   waits=variant.rank == 0)  # fmt: skip
            except NotReady:
                continue  # in a later round
            if variant.name in (EXACT, AS_SET):
                pictures[variant.name] = shot.last
            self._keep(found, shot, pictures)
            cost = self._cost(shot)
            if variant.name == self._plan.base.name:
                anchor, since = cost, 0
                for earlier, spent in waiting:
                    earlier.compare(spent, anchor, anchor)
                waiting = []
                continue
            waiting.append((found, cost))
            since += 1
            if anchor and since >= ANCHOR_EVERY:
                anchor, since, waiting = self._close(base_scene, seed, anchor, waiting), 0, []
        if anchor and waiting:
            self._close(base_scene, seed, anchor, waiting)

    def _close(self, scene: Scene, seed: int, before: _Time, waiting: list[tuple[_Found, _Time]]) -> _Time:
        """One more render of the scene as it is set; those since the last are held against both."""
        after = self._cost(self._shoot("as set, for the time", scene, seed, self._samples))
        for place, (found, cost) in enumerate(waiting, 1):
            found.compare(cost, before, after, place / (len(waiting) + 1))
        return after

    def _cost(self, shot: Shot) -> _Time:
        """What tracing took: the processors' time where they did it, which other jobs on the machine do not change."""
        return _Time(shot.trace_cpu_seconds if self._device == "CPU" else shot.trace_seconds, shot.settled)

    def _keep(self, found: _Found, shot: Shot, pictures: dict[str, Any]) -> None:
        found.build.append(shot.build_seconds)
        found.timed.setdefault(shot.settled, []).append(shot.trace_seconds)
        pictures_kept = shot.filtered if found.variant.denoised else shot.pictures
        for samples, picture in pictures_kept.items():
            found.tallies.setdefault(samples, Tally()).add(picture)
            relmse = relative_error(picture, self._truth, self._weight) - self._truth_relmse
            found.errors.setdefault(samples, []).append(relmse)
        against = pictures.get(found.variant.against, pictures.get(EXACT))
        last = pictures_kept[max(pictures_kept)]
        found.differences.add(last - (against if against is not None else last))

    # -- results ----------------------------------------------------------------------------------

    def _results(self) -> Report:
        base_name = self._plan.base.name
        measured = [
            f
            for f in self._found
            if f.differences.count >= LEAST_ROUNDS and (f.ratios or f.variant.name in (EXACT, base_name))
        ]
        if not measured or measured[0].variant.name != EXACT:
            raise Cancelled
        logs = [np.log(f.ratios) for f in measured if len(f.ratios) > 1]
        if logs:  # a few ratios tell their spread badly; the machine's restlessness is that of all
            self._ratio_spread = float(np.sqrt(np.median([np.var(found, ddof=1) for found in logs])))
        base = next((f for f in measured if f.variant.name == base_name), measured[0])
        width, height = self._small.film.size
        full_width, full_height = self.scene.film.size
        left_out = [f.variant.name for f in self._found if f not in measured]
        return Report(
            scene=self.scene.name, width=width, height=height, full_width=full_width, full_height=full_height,
            scene_samples=self.scene.settings.samples, device=self._device, seconds_asked=self.seconds,
            seconds=self.spent, reference_samples=self._reference_samples,
            reference_error=math.sqrt(self._truth_relmse), rows=[self._row(f, base) for f in measured],
            base=base.variant.name, identity=identity_of(self.scene), absent=self._plan.absent, unmeasured=[*left_out, *self._unmeasured],
            warnings=self._warnings, cancelled=self.cancelled,
        )  # fmt: skip

    def _row(self, found: _Found, base: _Found) -> Row:
        variant = found.variant
        cost, low, high = _ratio(found.ratios, self._ratio_spread) if found is not base else (1.0, 1.0, 1.0)
        noise = {n: noise_of(t, self._weight) for n, t in sorted(found.tallies.items()) if t.count >= LEAST_ROUNDS}
        line = fit_noise(list(noise.items()), variant.of(self.scene).settings.sampler)
        # What chooses paths otherwise has no bias of its own, but where light is clamped, noise decides what is cut.
        own = base if not variant.biased and not floor_of(base.differences, self._weight).sure else found
        floor = floor_of(own.differences, self._weight)
        errors = {n: float(np.mean(found.errors[n])) for n in noise}
        if variant.denoised:
            errors = {**self._filtered_errors, **errors}
            line = fit_errors(sorted(errors.items()))
        build = float(np.median(found.build))
        sample_seconds = cost * float(np.median(base.trace)) / self._samples
        bright, bright_spread = brightness_of(own.differences, self._truth)
        points = [
            Point(n, build + n * sample_seconds, math.sqrt(max(0.0, errors[n])), noise[n].error if n in noise else 0.0)
            for n in sorted(errors)
        ]
        return Row(
            name=variant.name, group=variant.group, reason=variant.reason, biased=variant.biased,
            effect=variant.effect, settings=dict(variant.settings), renders=found.differences.count,
            samples=self._samples, build_seconds=build, sample_seconds=sample_seconds, cost=cost, cost_low=low,
            cost_high=high, points=points, line=line, floor=floor, brightness=bright,
            brightness_spread=bright_spread, denoised=variant.denoised,
            denoise_seconds=self._denoise_seconds if variant.denoised else 0.0,
        )  # fmt: skip

    def pictures(self) -> dict[str, Any]:
        """To look at: the reference, and the mean of each variant's renders, float64 (H, W, 3), bottom row first."""
        shown = {"reference": self._truth}
        for found in self._found:
            if found.differences.count >= LEAST_ROUNDS:
                shown[found.variant.name] = found.tallies[self._samples].mean
        return shown


def _ratio(ratios: list[float], spread: float) -> tuple[float, float, float]:
    """Median of ratios with a 95 % interval. spread: of the logarithm of any ratio, at least."""
    if not ratios:  # renders by other kernels than those of the scene as it is set: nothing is known
        return 1.0, 0.0, math.inf
    logs = np.log(ratios)
    middle, own = float(np.median(logs)), float(np.std(logs, ddof=1)) if len(logs) > 1 else 0.0
    if len(logs) < 2 and spread == 0.0:
        return math.exp(middle), 0.0, math.inf
    half = NORMAL_95 * max(spread, own) / math.sqrt(len(logs))
    return math.exp(middle), math.exp(middle - half), math.exp(middle + half)


__all__ = ["Cancelled", "Session", "Told", "Watch"]

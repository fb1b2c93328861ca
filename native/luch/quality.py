"""One dial for those who want no more: how much error the picture may have; the scene's own curve says how to get there.

Each step asks for an error. Which settings reach it soonest is found on this scene: by a report (luch.report) where one
is given; else the picture is begun as it is set, and where its own curve foretells a long render, a pilot is flown
between two of its steps: a report of few choices that takes a tenth of that time. A choice that takes light away counts
with the largest bias that its measurement allows, and is taken only where it is surely sooner than what is left to do;
then the picture begins anew. Short renders fly none, unless the picture shows that its settings take too much light
for the error asked for. It ends by its own error, as with an error limit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luch.accuracy import percent
from luch.cuda.device import DeviceError
from luch.identity import identity_of
from luch.kept import Kept
from luch.report import files
from luch.report.plan import AS_SET, EXACT, Variant, exact_settings
from luch.report.results import Report, Row
from luch.report.schedule import Cancelled, Session, Told
from luch.report.sentences import duration
from luch.scene import Scene, Settings
from luch.stopping import CUSTOM, STEPS, UNLIMITED_SAMPLES

if TYPE_CHECKING:
    from luch.render import Progress, Result

    Render = Callable[..., Result]
    Watch = Callable[[Progress], bool]

TAKES_NOTHING = "REFERENCE"  # the step that allows no bias at all
PILOT_SHARE = 0.1  # of the seconds that the picture is foretold to take still
# Seconds. Shorter ones cannot tell choices apart that differ by SOONER; more is not needed.
LEAST_PILOT, MOST_PILOT = 2.0, 30.0
# Of that time must have been rendered before its forecast is believed: after .6 s a picture of 18 s foretold 90.
SEEN_SHARE = 0.05
# A picture that lost as much of its light to its settings, in parts of the error asked for, is looked at however short.
# The bias of single pixels is larger than that of the mean.
LOST_SHARE = 0.3
LEAST_LOOK = 0.4  # seconds; for the bias of settings alone
PATIENCE = 4.0  # a look may take so many times as long where a busy machine needs it
SOONER = 0.85  # of the time as the scene is set: a choice that gains less is not worth other settings
BIAS_SHARE = 0.7  # of the error asked for, that bias may make up
FILTERED_RESERVE = 1.2  # of the samples that a denoised picture is foretold to need
WAIT = frozenset({"precision"})  # settings that a GPU's general kernels do not serve
CHOICES = frozenset({"denoised", "clamp indirect 10", "clamp indirect 1", "4 bounces", "clamp 10, filter 1, 4 bounces",
                     "no light tree", "light tree", "fast precision"})  # fmt: skip


@dataclass(frozen=True)
class Choice:
    """Settings that reach an error, and why these."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    seconds: float = math.inf  # that the render is foretold to take


def choose(report: Report, step: str, begun: float = 0.0) -> Choice:
    """By a report. begun: the share of the picture as it is set that is there already, and would be lost by another
    choice. Raises KeyError for a step that there is not.
    """
    error = STEPS[step]
    if report.base != AS_SET and step != TAKES_NOTHING:
        return as_set(step)  # which had no time to be measured: there is nothing that others could be sooner than
    base, exact = report.base_row, report.row(EXACT)
    rows = [row for row in report.choices if row.name != EXACT]
    if step == TAKES_NOTHING and exact is not None:
        changes, rows = dict(exact.settings), [row for row in rows if row.settings.keys() == {"light_tree"}]
        base = exact
    else:
        changes = {}
        if base is not None and exact is not None and _seconds(base, error, report) == math.inf:
            base, changes = exact, dict(exact.settings)  # as it is set, it never gets there
    if base is None:
        return as_set(step, changes)
    own = _seconds(base, error, report)
    first = min(rows, key=lambda row: _seconds(row, error, report), default=base)
    seconds = _seconds(first, error, report)
    if not seconds < SOONER * own * (1.0 - begun):
        first, seconds = base, own
    name = "the scene as it is set" if first.name == report.base else f'"{first.name}"'
    wanted = {**changes, **first.settings, **_end(first, error, report)}
    told = f", foretold {duration(seconds)}" if math.isfinite(seconds) else ""
    return Choice(first.name, wanted, f"{step.capitalize()}: {percent(error)} % by {name}{told}", seconds)


def as_set(step: str, changes: dict[str, Any] | None = None) -> Choice:
    """Where nothing is known, or nothing is worth finding out."""
    wanted = {**(changes or {}), "error_limit": STEPS[step], "samples": UNLIMITED_SAMPLES}
    name, told = (EXACT, f'"{EXACT}"') if changes else (AS_SET, "the scene as it is set")
    return Choice(name, wanted, f"{step.capitalize()}: {percent(STEPS[step])} % by {told}")


def _bias(row: Row, report: Report) -> float:
    """Of the relMSE, the most that it may be; of the scene as it is set what is sure, as noise that a short pilot cannot
    see through is no reason to take more samples than a render without one.
    """
    if row.name == report.base:
        return row.floor_relmse
    return row.floor.high**2 if row.biased and not row.denoised else 0.0


def _seconds(row: Row, error: float, report: Report) -> float:
    """To an error, of the picture that the scene asks for."""
    rest = error * error - _bias(row, report)
    if _bias(row, report) > (BIAS_SHARE * error) ** 2:
        return math.inf
    samples = max(1.0, row.line.samples_for(rest) * (FILTERED_RESERVE if row.denoised else 1.0))
    # A time that is not sure counts with its upper end.
    return row.seconds_of(samples * row.cost_high / row.cost, report.pixels) if samples <= row.known_until else math.inf


def _end(row: Row, error: float, report: Report) -> dict[str, Any]:
    """How the render ends: by its noise, or, denoised, after so many samples, as its error is then no longer told."""
    if row.denoised:
        samples = math.ceil(FILTERED_RESERVE * max(1.0, row.line.samples_for(error * error)))
        return {"denoise": True, "samples": samples, "error_limit": 0.0}
    return {"error_limit": math.sqrt(error * error - _bias(row, report)), "samples": UNLIMITED_SAMPLES}


class _Dial:
    """A picture that was begun as it is set, and the pilot between two of its steps."""

    def __init__(self, scene: Scene, step: str, progress: Watch | None) -> None:
        self._scene, self._step, self._progress = scene, step, progress
        takes_nothing = step == TAKES_NOTHING
        self.choice = as_set(step, exact_settings(scene.settings) if takes_nothing else None)
        self.pilot_seconds = self.lost_seconds = 0.0  # lost: of a picture that began anew
        self.warnings: list[str] = []
        self._better: Choice | None = None  # the picture is to begin anew
        self._kept = Kept()  # what the pilot has built
        # Another choice would be the halves' own; nothing is to be chosen where nothing may be taken.
        self._decided = takes_nothing or scene.settings.verify
        self._looked = False
        self._start = time.perf_counter()

    def rendered(self, render: Render) -> Result:
        """The picture, in the end by self.choice."""
        settings = self._scene.settings
        result = render(replace(self._scene, settings=_changed(settings, self.choice)), progress=self._watch)
        if self._better is None:
            return result
        spent = time.perf_counter() - self._start
        self.choice, self.lost_seconds = self._better, spent - self.pilot_seconds
        changed = _changed(settings, self.choice)
        if changed.time_limit > 0.0:
            changed.time_limit = max(1e-3, changed.time_limit - spent)
        del result  # its renderer's memory
        result = render(replace(self._scene, settings=changed), progress=self._progress, kept=self._kept)
        result.stats["total_seconds"] += spent
        return result

    def _watch(self, told: Progress) -> bool:
        if self._progress is not None and not self._progress(told):
            return False
        if self._decided or not told.new_picture or told.curve is None or not told.curve.points:
            return True
        left = self._left(told)
        seconds = self._worth(told, left)
        return seconds <= 0.0 or self._fly(told, seconds, left)

    def _left(self, told: Progress) -> float:
        """Seconds until the picture is there, by its own curve."""
        left = told.forecast.seconds if told.forecast is not None else math.inf
        limit = self._scene.settings.time_limit
        return min(left, limit - (time.perf_counter() - self._start)) if limit > 0.0 else left

    def _worth(self, told: Progress, left: float) -> float:
        """Seconds for a pilot; 0: none now."""
        assert told.steering is not None
        seconds = min(MOST_PILOT, PILOT_SHARE * left)
        if not self._looked:
            self._looked = True
            if told.steering.lost() > LOST_SHARE * STEPS[self._step]:
                return max(LEAST_LOOK, seconds)
        seen = told.seconds >= SEEN_SHARE * min(left, MOST_PILOT / PILOT_SHARE)
        return seconds if seconds >= LEAST_PILOT and seen else 0.0

    def _fly(self, told: Progress, seconds: float, left: float) -> bool:
        """Whether the picture goes on."""
        assert told.steering is not None
        self._decided = True
        began = time.perf_counter()
        session = Session(self._to_try(), seconds, self._told_on(told), **self._variants(seconds), kept=self._kept)
        report = None
        try:
            report = session.run()
        except Cancelled:
            pass  # not even one choice in time, or the user's word: both are looked at below
        except (DeviceError, MemoryError) as error:
            self.warnings.append(f"No settings were chosen, there is no room for a pilot beside the picture: {error}")
        self.pilot_seconds = time.perf_counter() - began
        told.steering.leave_out(self.pilot_seconds)
        if session.cancelled or report is None:
            self._kept.drop()
            return not session.cancelled
        choice = choose(report, self._step, told.seconds / (told.seconds + left))
        if choice.settings.keys() == {"error_limit", "samples"}:
            told.steering.ask(choice.settings["error_limit"])
            found = f"{as_set(self._step).reason}; a pilot of {duration(self.pilot_seconds)} found nothing sooner"
            self.choice = replace(choice, reason=found)
            self._kept.drop()  # the picture has a renderer of its own
        else:
            self._better = choice
        return self._better is None

    def _to_try(self) -> Scene:
        """On a GPU by general kernels: choices have others, which would take longer to compile than a pilot lasts."""
        settings = self._scene.settings
        if settings.device == "CPU":
            return self._scene
        return replace(self._scene, settings=replace(settings, own_kernels=False))

    def _variants(self, seconds: float) -> dict[str, Any]:
        if seconds < LEAST_PILOT:
            return {"only": lambda variant: variant.rank == 0, "rounds": 2, "patience": PATIENCE}
        skipped = WAIT if self._scene.settings.device == "CUDA" else frozenset()
        return {"only": lambda variant: _worth_trying(variant) and not variant.settings.keys() & skipped}

    def _told_on(self, told: Progress) -> Callable[[Told], bool] | None:
        progress = self._progress
        return None if progress is None else lambda _: progress(replace(told, new_picture=False))


def _worth_trying(variant: Variant) -> bool:
    return variant.rank == 0 or variant.name in CHOICES


def rendered(scene: Scene, render: Render, progress: Watch | None) -> Result:
    """Renders the scene as Settings.quality says; statistics hold "quality". Raises ValueError for a step that there is
    not, or a report that cannot be read."""
    settings = scene.settings
    if settings.quality not in STEPS:
        raise ValueError(f"Settings: quality is {settings.quality!r}; it can be {CUSTOM}, {', '.join(STEPS)}.")
    report, warnings = _read(settings.quality_report, scene) if settings.quality_report else (None, [])
    if report is not None:
        choice = choose(report, settings.quality)
        result = render(replace(scene, settings=_changed(settings, choice)), progress=progress)
        pilot_seconds = lost_seconds = 0.0
    else:
        dial = _Dial(scene, settings.quality, progress)
        result = dial.rendered(render)
        choice, pilot_seconds, lost_seconds = dial.choice, dial.pilot_seconds, dial.lost_seconds
        warnings = [*warnings, *dial.warnings]
    result.stats["quality"] = {"step": settings.quality, "choice": choice.name, "settings": choice.settings,
                               "reason": choice.reason, "pilot_seconds": pilot_seconds,
                               "lost_seconds": lost_seconds}  # fmt: skip
    result.stats["warnings"] = [*result.stats.get("warnings", []), *warnings]
    return result


def _changed(settings: Settings, choice: Choice) -> Settings:
    return replace(settings, quality=CUSTOM, **choice.settings)


def _read(path: str, scene: Scene) -> tuple[Report | None, list[str]]:
    """None, and a warning, where it is another scene's. Raises ValueError where it is no report."""
    try:
        report = files.read(Path(path))
    except (OSError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: cannot be read as a report ({error}). Make it again.") from error
    if report.identity != identity_of(scene):
        whose = f'of another scene ("{report.scene}")' if report.identity else "older than this Luch"
        return None, [f"{path}: the report is {whose} and is not used. Make the report anew."]
    width, height = scene.film.size
    return replace(report, full_width=width, full_height=height), []

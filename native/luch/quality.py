"""One dial for those who want no more: how much error the picture may have; the scene's own curve says how to get there.

Each step asks for an error. Which settings reach it soonest is found on this scene: by a report (luch.report) where one
is given, else by a pilot: a first look, and a report of few choices that takes a tenth of the time that the render is foretold. A choice
that takes light away counts with the largest bias that its measurement allows, and is taken only where it is surely
sooner than the scene as it is set. The render itself then ends by its own error, as with an error limit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luch.accuracy import percent
from luch.identity import identity_of
from luch.kept import Kept
from luch.report import files
from luch.report.plan import EXACT, Variant, exact_settings
from luch.report.results import Report, Row
from luch.report.schedule import Cancelled, Session, Told
from luch.report.sentences import duration
from luch.scene import Scene
from luch.stopping import CUSTOM, STEPS, UNLIMITED_SAMPLES

if TYPE_CHECKING:
    from luch.render import Progress, Result

    Render = Callable[..., Result]
    Watch = Callable[[Progress], bool]

TAKES_NOTHING = "REFERENCE"  # the step that allows no bias at all
PILOT_SHARE = 0.1  # of the seconds that the render is foretold to take
LEAST_PILOT, MOST_PILOT = 0.4, 30.0  # seconds; less tells nothing, more is not needed
PILOT_GROWS = 4.0  # times as long as the look before: a short one may foretell five times too much
PATIENCE = 4.0  # the first look at a scene may take so many times LEAST_PILOT where a busy machine needs it
SOONER = 0.85  # of the time as the scene is set: a choice that gains less is not worth other settings
BIAS_SHARE = 0.7  # of the error asked for, that bias may make up
FILTERED_RESERVE = 1.2  # of the samples that a denoised picture is foretold to need
CHOICES = frozenset({"denoised", "clamp indirect 10", "clamp indirect 1", "4 bounces", "clamp 10, filter 1, 4 bounces",
                     "no light tree", "light tree", "fast precision"})  # fmt: skip


@dataclass(frozen=True)
class Choice:
    """Settings that reach an error, and why these."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    seconds: float = math.inf  # that the render is foretold to take


def choose(report: Report, step: str) -> Choice:
    """By a report. Raises KeyError for a step that there is not."""
    error = STEPS[step]
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
    if not seconds < SOONER * own:
        first, seconds = base, own
    name = "the scene as it is set" if first.name == report.base else f'"{first.name}"'
    wanted = {**changes, **first.settings, **_end(first, error)}
    told = f", foretold {duration(seconds)}" if math.isfinite(seconds) else ""
    return Choice(first.name, wanted, f"{step.capitalize()}: {percent(error)} % by {name}{told}", seconds)


def as_set(step: str, changes: dict[str, Any] | None = None) -> Choice:
    """Where nothing is known, or nothing is worth finding out."""
    wanted = {**(changes or {}), "error_limit": STEPS[step], "samples": UNLIMITED_SAMPLES}
    return Choice("as set", wanted, f"{step.capitalize()}: {percent(STEPS[step])} % by the scene as it is set")


def _bias(row: Row) -> float:
    """The most that it may be, of the relMSE."""
    return row.floor.high**2 if row.biased and not row.denoised else 0.0


def _seconds(row: Row, error: float, report: Report) -> float:
    """To an error, of the picture that the scene asks for."""
    rest = error * error - _bias(row)
    if _bias(row) > (BIAS_SHARE * error) ** 2:
        return math.inf
    samples = max(1.0, row.line.samples_for(rest) * (FILTERED_RESERVE if row.denoised else 1.0))
    # A time that is not sure counts with its upper end.
    return row.seconds_of(samples * row.cost_high / row.cost, report.pixels) if samples <= row.known_until else math.inf


def _end(row: Row, error: float) -> dict[str, Any]:
    """How the render ends: by its noise, or, denoised, after so many samples, as its error is then no longer told."""
    if row.denoised:
        samples = math.ceil(FILTERED_RESERVE * max(1.0, row.line.samples_for(error * error)))
        return {"denoise": True, "samples": samples, "error_limit": 0.0}
    return {"error_limit": math.sqrt(error * error - _bias(row)), "samples": UNLIMITED_SAMPLES}


def pilot(scene: Scene, step: str, watch: Callable[[Told], bool] | None = None, kept: Kept | None = None) -> Choice:
    """By a short report, if the render is going to be long enough to be worth one. Raises Cancelled when watch says no.

    kept: holds afterwards what was built for it, where there is room.
    """
    kept = kept or Kept()
    exact = exact_settings(scene.settings)
    plain = as_set(step, exact if step == TAKES_NOTHING else None)
    quick = Session(scene, LEAST_PILOT, watch, only=lambda variant: variant.rank == 0, rounds=2, patience=PATIENCE,
                    kept=kept)  # fmt: skip
    try:
        first = quick.run()
    except Cancelled:
        if quick.cancelled:
            raise
        return plain
    if quick.cancelled:
        raise Cancelled
    found, last, spent = choose(first, step), LEAST_PILOT, LEAST_PILOT
    while step != TAKES_NOTHING:
        # An endless forecast is no reason for an endless pilot; a look that is shorter than the last tells nothing more.
        seconds = min(MOST_PILOT - spent, PILOT_SHARE * found.seconds - spent, PILOT_GROWS * last)
        if seconds < last:
            break
        session = Session(scene, seconds, watch, only=_worth_trying, kept=kept)
        try:
            report = session.run()
        except Cancelled:
            if session.cancelled:
                raise
            break
        if session.cancelled:
            raise Cancelled
        found, last, spent = choose(report, step), seconds, spent + seconds
    return found


def _worth_trying(variant: Variant) -> bool:
    return variant.rank == 0 or variant.name in CHOICES


def rendered(scene: Scene, render: Render, progress: Watch | None) -> Result:
    """Renders the scene as Settings.quality says; statistics hold "quality". Raises ValueError for a step that there is
    not, or a report that cannot be read."""
    settings = scene.settings
    if settings.quality not in STEPS:
        raise ValueError(f"Settings: quality is {settings.quality!r}; it can be {CUSTOM}, {', '.join(STEPS)}.")
    start = time.perf_counter()
    kept = Kept()
    report, warnings = _read(settings.quality_report, scene) if settings.quality_report else (None, [])
    try:
        if report is not None:
            choice = choose(report, settings.quality)
        else:
            choice = pilot(scene, settings.quality, _told_on(progress), kept)
    except Cancelled:  # the render ends at its first question
        choice = as_set(settings.quality)
    spent = time.perf_counter() - start
    changed = replace(settings, quality=CUSTOM, **choice.settings)
    if changed.time_limit > 0.0:
        changed.time_limit = max(1e-3, changed.time_limit - spent)
    result = render(replace(scene, settings=changed), progress=progress, kept=kept)
    result.stats["quality"] = {"step": settings.quality, "choice": choice.name, "settings": choice.settings,
                               "reason": choice.reason, "pilot_seconds": spent}  # fmt: skip
    result.stats["total_seconds"] += spent
    result.stats["warnings"] = [*result.stats.get("warnings", []), *warnings]
    return result


def _read(path: str, scene: Scene) -> tuple[Report | None, list[str]]:
    """None, and a warning, where it is another scene's. Raises ValueError where it is no report."""
    try:
        report = files.read(Path(path))
    except (OSError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: cannot be read as a report ({error}). Make it again.") from error
    if report.identity != identity_of(scene):
        whose = f'of another scene ("{report.scene}")' if report.identity else "older than this Luch"
        return None, [
            f"{path}: the report is {whose} and is not used; a pilot chose the settings. Make the report anew."
        ]
    width, height = scene.film.size
    return replace(report, full_width=width, full_height=height), []


def _told_on(progress: Watch | None) -> Callable[[Told], bool] | None:
    if progress is None:
        return None
    from luch.render import preparing

    start = time.perf_counter()
    return lambda _: progress(preparing(0, start))

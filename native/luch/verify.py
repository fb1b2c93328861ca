"""Holds a render's own word against a second one: two halves with other seeds, each of which claims its error.

Their difference has, for any sampler, the expectation of what both claims together say. The picture that is handed on
is both halves merged, so that nothing is traced for the check alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from luch import ledger, merge, pixel_error
from luch.accuracy import NORMAL_95
from luch.render import Progress, Result, render
from luch.scene import Scene

# An error told within this factor is right, however narrow the intervals: relMSE within 0.8..1.25.
GOOD_FACTOR = math.sqrt(1.25)


def render_verified(scene: Scene, *, progress: Callable[[Progress], bool] | None = None) -> Result:
    """As luch.render.render; statistics also hold "verified". Raises ValueError likewise."""
    settings = scene.settings
    other = int(np.random.SeedSequence([settings.seed, 0x76657269]).generate_state(1)[0] >> 1)
    halves: list[Result] = []
    for index, seed in enumerate((settings.seed, other)):
        part = replace(
            settings, seed=seed, samples=max(2, math.ceil(settings.samples / 2)), verify=False, mergeable=True,
            estimate_error=True, time_limit=settings.time_limit / 2, error_limit=settings.error_limit * math.sqrt(2.0),
        )  # fmt: skip
        told = None if progress is None else _half_told(progress, index)
        halves.append(render(replace(scene, settings=part), progress=told))
        if halves[-1].cancelled:
            return halves[-1]
    return _merged(scene, halves)


def _half_told(progress: Callable[[Progress], bool], index: int) -> Callable[[Progress], bool]:
    return lambda told: progress(replace(told, fraction=0.5 * (index + told.fraction)))


def _merged(scene: Scene, halves: list[Result]) -> Result:
    parts = [half.sums for half in halves if half.sums is not None]
    sums = merge.merge(parts)
    film = sums.native()
    passes = dict(film.resolve())
    passes |= sums.error_passes(pixel_error.wanted(scene.film))
    stats = dict(halves[0].stats)
    for key in (
        "paths",
        "rays",
        "shadow_rays",
        "clamped_units",
        "cut_units",
        "non_finite_samples",
        *ledger.REFUSALS,
        "samples",
        "render_seconds",
        "prepare_seconds",
        "total_seconds",
    ):
        stats[key] = sum(half.stats[key] for half in halves)
    for key in [key for key in stats if key.startswith(("error_curve", "next_error", "seconds_to"))]:
        del stats[key]
    stats.update(ledger.shares(stats, passes["Combined"], scene.film.exposure))
    stats["samples_asked"] = scene.settings.samples
    found = sums.estimate()
    if found is not None and all("error" in half.stats for half in halves):
        stats.update(found.statistics())
        stats["verified"] = verdict([half.stats for half in halves], stats)
    return Result(passes, stats, sums=sums if scene.settings.mergeable else None)


def verdict(claims: list[dict[str, Any]], seen: Mapping[str, Any]) -> dict[str, Any]:
    """claims: statistics of two halves of equally many samples; seen: what their difference says of the whole."""
    claimed = 0.5 * math.hypot(*(claim["error"] for claim in claims))
    observed = seen["error"]
    if claimed == 0.0 or observed == 0.0:
        return {"claimed": claimed, "observed": observed, "holds": claimed == observed}
    doubts = [math.log(told["error_high"] / told["error"]) / NORMAL_95 for told in [*claims, seen] if told["error"] > 0]
    room = max(math.log(GOOD_FACTOR), NORMAL_95 * math.hypot(*doubts))
    ratio = observed / claimed
    return {
        "claimed": claimed, "observed": observed, "ratio": ratio,
        "ratio_low": math.exp(-room), "ratio_high": math.exp(room), "holds": abs(math.log(ratio)) <= room,
    }  # fmt: skip

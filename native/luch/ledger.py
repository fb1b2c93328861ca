"""What settings took from the light, so that nothing is lost in silence. Shares are of the whole picture's light.

Clamped light is counted as it is cut off. A path that a limit of bounces ends at a surface leaves unknown what lies
beyond: its throughput is counted, which is the share lost if the surfaces there are as bright as the picture. Russian
roulette takes nothing: survivors count for those that ended. Filter Glossy and missing caustics move or leave out light
that no path met, and are not counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from luch.accuracy import percent
from luch.scene import F32

# CLAMPED_UNIT and CUT_UNIT of luch/film/film.h.
CLAMPED_UNIT, CUT_UNIT = 2.0**-16, 2.0**-20
# Refusal of luch/film/film.h: where samples came to light that are not finite, and in words.
REFUSALS = {
    "refused_emission": "light that was met",
    "refused_direct": "light that was sampled",
    "refused_scatter": "surfaces",
    "refused_flight": "volumes",
    "refused_data": "passes",
}
# Below a ten thousandth nothing is said.
LEAST_SHARE = 1e-4


def shares(stats: Mapping[str, Any], combined: F32, exposure: float) -> dict[str, float]:
    """stats: of a renderer; combined: its picture. Empty where no path was traced."""
    paths = stats.get("paths", 0)
    if not paths:
        return {}
    clamped = stats["clamped_units"] * CLAMPED_UNIT / paths * exposure
    kept = max(0.0, float(np.mean(combined[..., :3], dtype=np.float64)))
    return {
        "clamped_share": clamped / (clamped + kept) if clamped > 0.0 else 0.0,
        "cut_share_estimate": stats["cut_units"] * CUT_UNIT / paths,
        "refused_share": stats["non_finite_samples"] / paths,
    }


def lines(stats: Mapping[str, Any]) -> list[str]:
    """For people: what was taken, one sentence each; none where nothing was."""
    told = []
    if stats.get("clamped_share", 0.0) > LEAST_SHARE:
        told.append(f"Clamping took {percent(stats['clamped_share'])} % of the light")
    if stats.get("cut_share_estimate", 0.0) > LEAST_SHARE:
        told.append(f"Limits of bounces took about {percent(stats['cut_share_estimate'])} % of the light")
    if stats.get("refused_share", 0.0) > 0.0:
        causes = ", ".join(f"{words} {stats[key]}" for key, words in REFUSALS.items() if stats.get(key))
        told.append(f"{percent(stats['refused_share'])} % of the samples were not finite and were refused ({causes})")
    return told

"""What a report comes to, in sentences for people."""

from __future__ import annotations

import math

from luch.accuracy import percent
from luch.report.results import Report, Row

BUDGETS = (30.0, 300.0)  # seconds for the picture that the scene asks for
# A gain below this is not worth another setting; nor is what the measurement does not tell.
WORTH = 0.05
LITTLE_CHANGE, LARGE_COST = 0.01, 0.02
NAMED = 6  # effects that get a sentence


def sentences(report: Report) -> list[str]:
    """The least error within a time, what bias and noise do to the scene as it is set, what effects cost."""
    base = report.base_row
    if base is None:
        return []
    told = [sentence for seconds in BUDGETS for sentence in _least_error(report, base, seconds)]
    told += _floor(report, base)
    told += _structures(report)
    told += _denoising(report, base)
    told += _effects(report)
    if report.unmeasured:
        told.append(f"There was no time to measure {_listed(report.unmeasured)}: give the report more seconds.")
    return told


def _picture(report: Report) -> str:
    return f"at {report.full_width} x {report.full_height}"


def duration(seconds: float) -> str:
    """ "41 s", "5 min", "2.5 h"."""
    unit, length = next(((u, n) for u, n in (("h", 3600.0), ("min", 60.0)) if seconds >= 2.0 * n), ("s", 1.0))
    count = seconds / length
    return f"{count:,.0f} {unit}" if count >= 10.0 else f"{count:.2g} {unit}"


def _sampled(report: Report, row: Row, seconds: float) -> float:
    """0 where it is not known what so many bring."""
    samples = row.samples_in(seconds, report.pixels)
    return samples if samples <= row.known_until else 0.0


def best(report: Report, seconds: float) -> Row | None:
    """The choice with the least error within a time; the scene as it is set unless another one is worth it."""
    able = [row for row in report.choices if _sampled(report, row, seconds) >= 1.0]
    if not able:
        return None
    first = min(able, key=lambda row: _surely(row, _sampled(report, row, seconds)))
    base = report.base_row
    if base in able and base is not None:
        own = base.error_at(_sampled(report, base, seconds))
        if _surely(first, _sampled(report, first, seconds)) > (1.0 - WORTH) * own:
            return base
    return first


def _surely(row: Row, samples: float) -> float:
    """Its error, at the largest bias and the longest time that the measurement allows."""
    bias = row.floor.high if row.biased and not row.denoised else 0.0
    return math.hypot(bias, math.sqrt(row.line.relmse(max(samples * row.cost / row.cost_high, 1.0))))


def _least_error(report: Report, base: Row, seconds: float) -> list[str]:
    first = best(report, seconds)
    if first is None:
        return [f"{duration(seconds)} are too few for one sample of every pixel {_picture(report)}."]
    samples = _sampled(report, first, seconds)
    error = percent(first.error_at(samples))
    name = "the scene as it is set" if first is base else f'"{first.name}"'
    text = f"Within {duration(seconds)} {_picture(report)} the least error is reached by {name}: {error} % with {samples:.0f} samples"
    if first is not base:
        own = _sampled(report, base, seconds)
        if own >= 1.0:
            text += f", where the scene as it is set has {percent(base.error_at(own))} %"
        if not first.denoised and first.floor_relmse > 0.0:
            text += f"; it never goes under {percent(first.floor_error)} %"
    return [text + "."]


def _floor(report: Report, base: Row) -> list[str]:
    if base.floor_relmse == 0.0:
        known = f" (below {percent(base.floor.high)} %)" if base.floor.high > 0.0 else ""
        return [f"The settings of the scene take no light that could be measured{known}: more samples lower its error."]
    samples = base.crossing_samples
    seconds = base.seconds_of(samples, report.pixels)
    text = (
        f"As it is set, the error never goes under {percent(base.floor_error)} % "
        f"({percent(base.floor.low)} to {percent(base.floor.high)} %)"
    )
    if samples < 1.0:
        return [f"{text}, and noise is below that from the first sample on."]
    return [
        f"{text}; noise has fallen to that after {samples:.0f} samples ({duration(seconds)}), and more samples buy little."
    ]


def _structures(report: Report) -> list[str]:
    rows = [row for row in report.rows if row.group == "Structure"]
    if not rows:
        return []
    costs = ", ".join(f"{row.name} {row.cost:.2f}" for row in sorted(rows, key=lambda row: row.cost))
    quick = [row for row in rows if row.cost_high < 1.0 - WORTH]
    if quick:
        first = min(quick, key=lambda row: row.cost)
        return [
            f"The {first.name} takes {first.cost:.2f} times the time of the structure that the scene uses; of all: {costs}."
        ]
    return [f"No structure is surely faster than the one that the scene uses; time beside it: {costs}."]


def _denoising(report: Report, base: Row) -> list[str]:
    row = next((row for row in report.rows if row.denoised), None)
    if row is None or not row.points:
        return []
    last = row.at_taken()
    noisy = base.error_at(last.samples)
    equal = base.line.samples_for(last.error**2 - base.floor_relmse) if last.error**2 > base.floor_relmse else math.inf
    text = f"Denoised, {last.samples} samples err by {percent(last.error)} % instead of {percent(noisy)} %"
    if last.error < noisy and math.isfinite(equal):
        text += f", as much as {equal:.0f} samples without"
    text += f"; its bias there is {percent(row.floor.error)} %"
    return [text + "."]


def _effects(report: Report) -> list[str]:
    told, most = [], [row for row in report.effects if row.biased]
    for row in most[:NAMED]:
        if row.cost_share < LARGE_COST:
            continue
        change = f"changes by {percent(row.floor.error)} %" if row.floor.sure else _unchanged(row)
        told.append(f"{_capital(row.effect)}: {_share(row)} of the cost; left out, the picture {change}.")
    saving = [row for row in most if row.cost_low < row.cost_high < 1.0 - LARGE_COST and row.floor.high < LITTLE_CHANGE]
    for row in saving[:NAMED]:
        told.append(f"{_capital(row.effect)} could be left out: {100.0 * row.cost_share:.0f} % less time for less "
                    f"than {percent(row.floor.high)} % of error.")  # fmt: skip
    return told


def _share(row: Row) -> str:
    low, high = 1.0 - row.cost_high, 1.0 - row.cost_low
    return f"{100.0 * row.cost_share:.0f} % ({100.0 * low:.0f} to {100.0 * high:.0f})"


def _capital(text: str) -> str:
    """AOVs stay AOVs."""
    return text[:1].upper() + text[1:]


def _unchanged(row: Row) -> str:
    return f"does not change measurably (below {percent(row.floor.high)} %)"


def _listed(names: list[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)

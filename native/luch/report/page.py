"""The report as one HTML file: no request leaves it, plots are SVG, pictures are inside."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Mapping

from luch.accuracy import percent
from luch.report import chart
from luch.report.results import Report, Row
from luch.report.sentences import duration

STYLE = """
:root{color-scheme:light dark;--bar:#0088cc44;--line:#8885}
body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}
table{border-collapse:collapse;width:100%;font-size:13px}
th,td{text-align:left;padding:.25em .6em .25em 0;border-bottom:1px solid var(--line);vertical-align:top}
td:first-child{min-width:15em}td.n{text-align:right;white-space:nowrap}th.n{text-align:right}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(320px,1fr));gap:1.5em}
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(180px,1fr));gap:1em}
figure{margin:0}figure img{width:100%;image-rendering:pixelated}figcaption,.small{font-size:12px;opacity:.8}
.bar{background:linear-gradient(90deg,var(--bar) var(--w),transparent var(--w))}
"""


def page(report: Report, pictures: Mapping[str, bytes]) -> str:
    """pictures: caption -> a PNG file's bytes."""
    title = f"What accuracy costs: {report.scene}"
    parts = [
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{_text(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>',
        f"<h1>{_text(title)}</h1>{_facts(report)}",
        "<ul>" + "".join(f"<li>{_text(sentence)}</li>" for sentence in report.sentences) + "</ul>",
        _pictures(pictures),
        "<h2>Error against time</h2>" + _how_to_read(report),
        '<div class="plots">'
        + "".join(chart.svg(report, name, rows) for name, rows in chart.groups(report))
        + "</div>",
        "<h2>Ways to render this scene</h2>" + _choices(report),
        "<h2>What its effects cost, and what they change</h2>" + _effects(report),
        _rest(report),
        "</body></html>\n",
    ]
    return "\n".join(parts)


def _text(text: str) -> str:
    return html.escape(text)


def _facts(report: Report) -> str:
    size = f"{report.width} x {report.height} pixels"
    full = f"{report.full_width} x {report.full_height}"
    stopped = " It was ended by the user." if report.cancelled else ""
    return (
        f'<p class="small">Measured on {size} ({_text(report.device)}) in {report.seconds:.0f} s, against a reference of '
        f"{report.reference_samples} samples, which errs by {percent(report.reference_error)} % itself (taken out of all "
        f"errors). Seconds are those of the picture that the scene asks for, {full}: building, and tracing in proportion "
        f"to its pixels. Errors: square root of the relative squared error, mean over pixels.{stopped}</p>"
    )


def _how_to_read(report: Report) -> str:
    return (
        '<p class="small">Dots: small pictures held against the reference. Lines: noise, which falls with the samples, and '
        "bias, which stays; both are told apart by renders with several seeds. Dashed: the bias, under which the error "
        "never goes. Grey in every plot: the scene as it is set.</p>"
    )


def _pictures(pictures: Mapping[str, bytes]) -> str:
    figures = "".join(
        f'<figure><img alt="{_text(caption)}" src="data:image/png;base64,{base64.b64encode(data).decode()}">'
        f"<figcaption>{_text(caption)}</figcaption></figure>"
        for caption, data in pictures.items()
    )
    return f'<div class="pictures">{figures}</div>' if figures else ""


def _table(headings: Iterable[str], rows: Iterable[Iterable[str]], numbers_from: int = 1) -> str:
    """Cells are HTML; those from `numbers_from` on are numbers."""

    def line(cells: Iterable[str], tag: str) -> str:
        kinds = (f"<{tag}{' class=n' if k >= numbers_from else ''}>{cell}</{tag}>" for k, cell in enumerate(cells))
        return f"<tr>{''.join(kinds)}</tr>"

    return f"<table>{line(headings, 'th')}{''.join(line(row, 'td') for row in rows)}</table>"


def interval(row: Row) -> str:
    """Of the floor, as a cell: "0.9 % (0.8 to 1)", or below what nothing was seen."""
    if row.floor.sure:
        return f"{percent(row.floor.error)} % ({percent(row.floor.low)} to {percent(row.floor.high)})"
    return f"none seen (&lt; {percent(row.floor.high)} %)" if row.floor.high > 0.0 else "none"


def _cost(row: Row) -> str:
    if row.cost_low == row.cost_high:
        return f"{row.cost:.2f}"
    if not math.isfinite(row.cost_high):
        return f"{row.cost:.2f} (not sure)"
    return f"{row.cost:.2f} ({row.cost_low:.2f} to {row.cost_high:.2f})"


def _choices(report: Report) -> str:
    rows = []
    for row in report.choices:
        last = row.at_taken()
        crossing = row.crossing_samples
        rows.append([
            f'{_text(row.name)}<div class="small">{_text(row.reason)}</div>', _cost(row), f"{row.build_seconds:.2f} s",
            f"{percent(last.error)} %", f"{percent(last.noise)} %", interval(row),
            f"{crossing:.0f}" if 1.0 <= crossing < 1e7 else "first" if crossing < 1.0 else "",
            f"{100.0 * row.brightness:+.2f} %", *_reaching(report, row),
        ])  # fmt: skip
    samples = report.rows[0].samples if report.rows else 0
    head = ["", "time", "building", f"error, {samples} samples", "noise of it", "bias: the floor",
            "samples until noise is below it", "brightness", "to 5 %", "to 1 %"]  # fmt: skip
    return _table(head, rows)


def _reaching(report: Report, row: Row) -> list[str]:
    times = [row.seconds_for(error, report.pixels) for error in (0.05, 0.01)]
    return [duration(seconds) if math.isfinite(seconds) else "" if row.denoised else "never" for seconds in times]


def _effects(report: Report) -> str:
    base = report.base_row
    if base is None or not report.effects:
        return "<p>None that could be left out.</p>"
    whole = report.pixels * base.sample_seconds * report.scene_samples
    rows = []
    for row in report.effects:
        low, high = 1.0 - row.cost_high, 1.0 - row.cost_low
        width = min(100.0, max(0.0, 100.0 * row.cost_share))
        rows.append([
            f'<div class="bar" style="--w:{width:.0f}%">{_text(row.effect)}</div><div class="small">{_text(row.reason)}</div>',
            f"{100.0 * row.cost_share:.0f} % ({100.0 * low:.0f} to {100.0 * high:.0f})",
            duration(whole * row.cost_share) if row.cost_share > 0.0 else "none",
            interval(row), f"{100.0 * row.brightness:+.2f} %",
        ])  # fmt: skip
    head = [
        "effect",
        "share of the time",
        f"of {duration(whole)}",
        "error if it were left out",
        "brightness without it",
    ]
    return _table(head, rows)


def _rest(report: Report) -> str:
    lists = [("Not tried", report.absent), ("No time was left for", report.unmeasured), ("Warnings", report.warnings)]
    return "".join(
        f"<h2>{name}</h2><ul>" + "".join(f"<li>{_text(line)}</li>" for line in lines) + "</ul>"
        for name, lines in lists
        if lines
    )

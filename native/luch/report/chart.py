"""Plots of error against time, drawn alike into SVG (for the page) and pixels (for PNG)."""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from luch.axes import LogAxis
from luch.image import openimageio
from luch.report.results import Report, Row

WIDTH, HEIGHT = 440, 300  # units of one plot
LEFT, RIGHT, TOP, BOTTOM = 46, 10, 24, 34
LEGEND_LINE = 15
# Told apart on white and on black, and by those who see few colours (after Okabe and Ito 2008).
COLORS = ("#888888", "#0088cc", "#e08214", "#009e73", "#cc5599", "#b59f00", "#7a6fd0", "#d04040", "#40a0a0", "#996633")
CURVE_STEPS = 24
FORWARD = 256.0  # a curve goes on to so many times the samples that were taken

XY = tuple[float, float]


class Canvas(Protocol):
    """Places run from the top left. ink: a colour, or "" for that of text."""

    def line(self, points: Sequence[XY], ink: str, *, dashed: bool = False, faint: bool = False) -> None: ...
    def dot(self, place: XY, ink: str) -> None: ...
    def text(self, place: XY, text: str, anchor: str = "start", ink: str = "") -> None: ...


class Svg:
    """One <svg>; what has no colour of its own takes the page's."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self._parts = [
            f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{html.escape(title)}" '
            'font-family="system-ui,sans-serif" font-size="11">'
        ]

    def line(self, points: Sequence[XY], ink: str, *, dashed: bool = False, faint: bool = False) -> None:
        style = ' stroke-dasharray="4 4"' if dashed else ""
        style += ' stroke-opacity=".18"' if faint else ' stroke-width="1.6"'
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self._parts.append(f'<polyline points="{path}" fill="none" stroke="{ink or "currentColor"}"{style}/>')

    def dot(self, place: XY, ink: str) -> None:
        self._parts.append(f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="2.6" fill="{ink}"/>')

    def text(self, place: XY, text: str, anchor: str = "start", ink: str = "") -> None:
        self._parts.append(f'<text x="{place[0]:.1f}" y="{place[1]:.1f}" text-anchor="{anchor}" '
                           f'fill="{ink or "currentColor"}">{html.escape(text)}</text>')  # fmt: skip

    def __str__(self) -> str:
        return "".join([*self._parts, "</svg>"])


class Pixels:
    """8-bit RGB on white, `scale` pixels a unit; origin: where its plot begins."""

    def __init__(self, width: float, height: float, scale: float = 2.0) -> None:
        self._oiio: Any = openimageio()
        spec = self._oiio.ImageSpec(int(width * scale), int(height * scale), 3, "uint8")
        self._buffer = self._oiio.ImageBuf(spec)
        self._oiio.ImageBufAlgo.fill(self._buffer, (1.0, 1.0, 1.0))
        self._scale, self.origin = scale, (0.0, 0.0)

    def _at(self, place: XY) -> tuple[int, int]:
        return tuple(round((own + from_) * self._scale) for own, from_ in zip(place, self.origin, strict=True))  # type: ignore[return-value]

    @staticmethod
    def _color(ink: str, faint: bool = False) -> tuple[float, float, float]:
        if not ink:
            return (0.86, 0.86, 0.86) if faint else (0.15, 0.15, 0.15)
        return tuple(int(ink[k : k + 2], 16) / 255.0 for k in (1, 3, 5))  # type: ignore[return-value]

    def line(self, points: Sequence[XY], ink: str, *, dashed: bool = False, faint: bool = False) -> None:
        for number, (start, end) in enumerate(itertools.pairwise(points)):
            if dashed and number % 2:
                continue
            (x0, y0), (x1, y1) = self._at(start), self._at(end)
            for wide in range(1 if faint else 3):
                self._oiio.ImageBufAlgo.render_line(self._buffer, x0, y0 + wide, x1, y1 + wide, self._color(ink, faint))

    def dot(self, place: XY, ink: str) -> None:
        x, y = self._at(place)
        self._oiio.ImageBufAlgo.render_box(self._buffer, x - 4, y - 4, x + 4, y + 4, self._color(ink), True)

    def text(self, place: XY, text: str, anchor: str = "start", ink: str = "") -> None:
        x, y = self._at(place)
        align = {"start": "left", "middle": "center", "end": "right"}[anchor]
        self._oiio.ImageBufAlgo.render_text(self._buffer, x, y, text, int(11 * self._scale), "", self._color(ink),
                                            alignx=align)  # fmt: skip

    def write(self, path: str) -> None:
        """Raises OSError if it cannot be."""
        if not self._buffer.write(path):
            raise OSError(f"{path}: cannot be written ({self._buffer.geterror()})")


def groups(report: Report) -> list[tuple[str, list[Row]]]:
    """What stands in one plot, with the scene as it is set first in each."""
    names = list(dict.fromkeys(row.group for row in report.choices))
    base = report.base_row
    shown = []
    for name in names:
        rows = [row for row in report.choices if row.group == name and row is not base]
        if rows and base is not None:
            shown.append((name, [base, *rows]))
    return shown


def height_of(rows: Sequence[Row]) -> float:
    """Of a plot with its legend."""
    return HEIGHT + LEGEND_LINE * len(rows)


def draw(canvas: Canvas, report: Report, title: str, rows: Sequence[Row]) -> None:
    """Error of the picture that the scene asks for against seconds, both logarithmic: curves as measured and as they go
    on (bias and noise), dots where the small picture was held against the reference, the floor dashed."""
    seconds = [s for row in rows for s in (_seconds(report, row, 2.0), _seconds(report, row, 32.0 * row.samples))]
    errors = [e for row in rows for e in (row.error_at(2.0), row.error_at(32.0 * row.samples)) if e > 0.0] or [0.01]
    x = LogAxis(0.9 * min(seconds), max(seconds), LEFT, WIDTH - LEFT - RIGHT)
    y = LogAxis(0.9 * min(errors), 1.1 * max(errors), HEIGHT - BOTTOM, TOP + BOTTOM - HEIGHT)
    _frame(canvas, title, x, y)
    for number, row in enumerate(rows):
        ink = COLORS[number % len(COLORS)]
        counts = np.geomspace(1.0, min(FORWARD * row.samples, row.known_until), 2 * CURVE_STEPS)
        places = [(_seconds(report, row, n), row.error_at(n)) for n in counts]
        inside = [(x.at(s), y.at(e)) for s, e in places if x.holds(s) and y.holds(e)]
        if len(inside) > 1:
            canvas.line(inside, ink)
        if row.floor_error > 0.0 and y.holds(row.floor_error):
            level = y.at(row.floor_error)
            ends = np.linspace(LEFT, WIDTH - RIGHT, 2 * CURVE_STEPS)
            canvas.line([(float(end), level) for end in ends], ink, dashed=True)
        for point in row.points:
            place = _seconds(report, row, point.samples), point.error
            if x.holds(place[0]) and y.holds(place[1]):
                canvas.dot((x.at(place[0]), y.at(place[1])), ink)
        level = HEIGHT + LEGEND_LINE * number + 4
        canvas.line([(LEFT, level - 4), (LEFT + 18, level - 4)], ink)
        floor = f", floor {100.0 * row.floor_error:.2g} %" if row.floor_error > 0.0 else ""
        canvas.text((LEFT + 24, level), f"{row.name}{floor}")


def _seconds(report: Report, row: Row, samples: float) -> float:
    return row.seconds_of(samples, report.pixels)


def _frame(canvas: Canvas, title: str, x: LogAxis, y: LogAxis) -> None:
    canvas.text((LEFT, 14), title)
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    for value in x.ticks():
        place = x.at(value)
        canvas.line([(place, TOP), (place, bottom)], "", faint=True)
        if _round(value) or math.exp(x.high - x.low) < 30.0:
            canvas.text((place, bottom + 13), f"{value:g}", "middle")
    for value in y.ticks():
        level = y.at(value)
        canvas.line([(LEFT, level), (right, level)], "", faint=True)
        canvas.text((LEFT - 5, level + 4), f"{100.0 * value:g} %", "end")
    canvas.text(((LEFT + right) / 2.0, bottom + 27), "seconds", "middle")


def _round(value: float) -> bool:
    """A power of ten."""
    return abs(math.log10(value) - round(math.log10(value))) < 1e-9


def svg(report: Report, title: str, rows: Sequence[Row]) -> str:
    canvas = Svg(WIDTH, height_of(rows), f"{title}: error against seconds")
    draw(canvas, report, title, rows)
    return str(canvas)


def write_png(report: Report, path: str) -> None:
    """All plots side by side, two in a row. Raises OSError."""
    shown = groups(report)
    lines = [max(height_of(rows) for _, rows in shown[k : k + 2]) for k in range(0, len(shown), 2)]
    canvas = Pixels(2 * WIDTH, sum(lines) or HEIGHT)
    for number, (title, rows) in enumerate(shown):
        canvas.origin = float(number % 2 * WIDTH), float(sum(lines[: number // 2]))
        draw(canvas, report, title, rows)
    canvas.write(path)

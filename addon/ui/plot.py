"""Draws a curve of errors into pixels with NumPy: Blender carries no plotting library."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
WIDTH, HEIGHT, MARGIN = 480, 240, 12  # pixels
BACKGROUND, GRID, BAR, LINE, DOT, AIM = (
    (0.12, 0.12, 0.12), (0.2, 0.2, 0.2), (0.35, 0.45, 0.6), (0.45, 0.6, 0.85), (0.95, 0.95, 0.95), (0.9, 0.55, 0.2),
)  # fmt: skip
# seconds, error, its interval
Point = tuple[float, float, float, float]


class Axis:
    """Logarithms of a range onto pixels."""

    def __init__(self, low: float, high: float, pixels: int) -> None:
        self.low, self.high = np.log(low), np.log(max(high, 1.5 * low))
        self._pixels = pixels - 2 * MARGIN - 1

    def at(self, value: float) -> int:
        share = (np.log(max(value, 1e-30)) - self.low) / (self.high - self.low)
        return MARGIN + round(float(np.clip(share, 0.0, 1.0)) * self._pixels)

    def ticks(self) -> list[float]:
        """1, 2 and 5 times powers of ten within the range."""
        decades = range(int(np.floor(self.low / np.log(10.0))), int(np.ceil(self.high / np.log(10.0))) + 1)
        values = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
        return [value for value in values if self.low <= np.log(value) <= self.high]


def axes(points: Sequence[Point], aim: float, aim_seconds: float) -> tuple[Axis, Axis]:
    """Of seconds and of errors, wide enough for the points and for the error aimed at (0: none)."""
    seconds = [max(point[0], 1e-3) for point in points] + ([aim_seconds] if np.isfinite(aim_seconds) else [])
    errors = [point[1] for point in points] + [point[3] for point in points] + ([aim] if aim > 0.0 else [])
    errors = [error for error in errors if error > 0.0] or [1e-3]
    return Axis(min(seconds), max(seconds), WIDTH), Axis(0.9 * min(errors), 1.1 * max(errors), HEIGHT)


def draw_curve(points: Sequence[Point], aim: float = 0.0, aim_seconds: float = np.inf) -> F32:
    """RGBA (HEIGHT, WIDTH, 4), bottom row first: errors over seconds, both logarithmic, with their intervals, and the
    forecast of the error aimed at."""
    picture = np.ones((HEIGHT, WIDTH, 4), np.float32)
    picture[..., :3] = BACKGROUND
    if not points:
        return picture
    x, y = axes(points, aim, aim_seconds)
    for tick in x.ticks():
        picture[MARGIN:-MARGIN, x.at(tick), :3] = GRID
    for tick in y.ticks():
        picture[y.at(tick), MARGIN:-MARGIN, :3] = GRID
    if aim > 0.0:
        picture[y.at(aim), MARGIN:-MARGIN:2, :3] = AIM
    for seconds, _, low, high in points:
        picture[y.at(low) : y.at(high) + 1, x.at(seconds), :3] = BAR
    places = [(x.at(seconds), y.at(error)) for seconds, error, _, _ in points]
    for start, end in itertools.pairwise(places):
        _line(picture, start, end, LINE)
    if aim > 0.0 and np.isfinite(aim_seconds):
        _line(picture, places[-1], (x.at(aim_seconds), y.at(aim)), AIM)
        _dot(picture, (x.at(aim_seconds), y.at(aim)), AIM)
    for place in places:
        _dot(picture, place, DOT)
    return picture


def _line(picture: F32, start: tuple[int, int], end: tuple[int, int], color: tuple[float, ...]) -> None:
    steps = max(abs(end[0] - start[0]), abs(end[1] - start[1]), 1) + 1
    columns = np.rint(np.linspace(start[0], end[0], steps)).astype(int)
    rows = np.rint(np.linspace(start[1], end[1], steps)).astype(int)
    picture[rows, columns, :3] = color


def _dot(picture: F32, place: tuple[int, int], color: tuple[float, ...]) -> None:
    column, row = place
    picture[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2, :3] = color

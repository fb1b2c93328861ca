"""Draws a curve of errors into pixels with NumPy: Blender carries no plotting library."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from luch.axes import LogAxis
from numpy.typing import NDArray

F32 = NDArray[np.float32]
WIDTH, HEIGHT, MARGIN = 480, 240, 12  # pixels
BACKGROUND, GRID, BAR, LINE, DOT, AIM = (
    (0.12, 0.12, 0.12), (0.2, 0.2, 0.2), (0.35, 0.45, 0.6), (0.45, 0.6, 0.85), (0.95, 0.95, 0.95), (0.9, 0.55, 0.2),
)  # fmt: skip
# seconds, error, its interval
Point = tuple[float, float, float, float]


def axes(points: Sequence[Point], aim: float, aim_seconds: float) -> tuple[LogAxis, LogAxis]:
    """Of seconds and of errors, wide enough for the points and for the error aimed at (0: none)."""
    seconds = [max(point[0], 1e-3) for point in points] + ([aim_seconds] if np.isfinite(aim_seconds) else [])
    errors = [point[1] for point in points] + [point[3] for point in points] + ([aim] if aim > 0.0 else [])
    errors = [error for error in errors if error > 0.0] or [1e-3]
    return (
        LogAxis(min(seconds), max(seconds), MARGIN, WIDTH - 2 * MARGIN - 1),
        LogAxis(0.9 * min(errors), 1.1 * max(errors), MARGIN, HEIGHT - 2 * MARGIN - 1),
    )


def draw_curve(points: Sequence[Point], aim: float = 0.0, aim_seconds: float = np.inf) -> F32:
    """RGBA (HEIGHT, WIDTH, 4), bottom row first: errors over seconds, both logarithmic, with their intervals, and the
    forecast of the error aimed at."""
    picture = np.ones((HEIGHT, WIDTH, 4), np.float32)
    picture[..., :3] = BACKGROUND
    if not points:
        return picture
    across, up = axes(points, aim, aim_seconds)

    def x(value: float) -> int:
        return round(across.at(value))

    def y(value: float) -> int:
        return round(up.at(value))

    for tick in across.ticks():
        picture[MARGIN:-MARGIN, x(tick), :3] = GRID
    for tick in up.ticks():
        picture[y(tick), MARGIN:-MARGIN, :3] = GRID
    if aim > 0.0:
        picture[y(aim), MARGIN:-MARGIN:2, :3] = AIM
    for seconds, _, low, high in points:
        picture[y(low) : y(high) + 1, x(seconds), :3] = BAR
    places = [(x(seconds), y(error)) for seconds, error, _, _ in points]
    for start, end in itertools.pairwise(places):
        _line(picture, start, end, LINE)
    if aim > 0.0 and np.isfinite(aim_seconds):
        _line(picture, places[-1], (x(aim_seconds), y(aim)), AIM)
        _dot(picture, (x(aim_seconds), y(aim)), AIM)
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

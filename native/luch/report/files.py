"""A report's files: report.html (everything in one), report.json, curves.csv, effects.csv, error_time.png, pictures."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from luch import image
from luch.accuracy import F64
from luch.report import chart
from luch.report.page import page
from luch.report.results import Report, from_dict

PICTURES = 6  # of effects left out, on the page
HTML, JSON = "report.html", "report.json"


def write(report: Report, pictures: Mapping[str, F64], folder: Path) -> Path:
    """Writes all files into the folder, which is made; returns the page's path. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / JSON).write_text(json.dumps(report.as_dict(), indent=1) + "\n", encoding="utf-8")
    _write_curves(report, folder / "curves.csv")
    _write_effects(report, folder / "effects.csv")
    chart.write_png(report, str(folder / "error_time.png"))
    inside = {}
    for name, caption in _shown(report).items():
        if name in pictures:
            path = folder / f"{name.replace(' ', '_')}.png"
            image.write_png(path, pictures[name].astype(np.float32))
            inside[caption] = path.read_bytes()
    (folder / HTML).write_text(page(report, inside), encoding="utf-8")
    return folder / HTML


def read(path: Path) -> Report:
    """A report.json. Raises OSError, ValueError."""
    return from_dict(json.loads(path.read_text(encoding="utf-8")))


def _shown(report: Report) -> dict[str, str]:
    """Names of pictures -> what stands below them."""
    shown = {"reference": f"the reference, {report.reference_samples} samples"}
    base = report.base_row
    if base is not None:
        shown[base.name] = f"as the scene is set, {base.renders} renders of {base.samples} samples together"
    denoised = next((row for row in report.rows if row.denoised), None)
    if denoised is not None:
        shown[denoised.name] = f"denoised, mean of {denoised.renders} renders"
    changing = sorted((row for row in report.effects if row.biased), key=lambda row: -row.floor.error)
    for row in changing[:PICTURES]:
        shown[row.name] = f"without {row.effect}"
    return shown


def _write_curves(report: Report, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["name", "group", "samples", "seconds", "seconds_full_picture", "error", "noise", "floor",
                        "floor_low", "floor_high", "brightness", "cost"])  # fmt: skip
        for row in report.rows:
            for point in row.points:
                full = row.seconds_of(point.samples, report.pixels)
                numbers = (point.seconds, full, point.error, point.noise, row.floor.error, row.floor.low, row.floor.high,
                           row.brightness, row.cost)  # fmt: skip
                table.writerow([row.name, row.group, point.samples, *(f"{number:.6g}" for number in numbers)])


def _write_effects(report: Report, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["effect", "cost_share", "cost_share_low", "cost_share_high", "error_if_left_out", "error_low",
                        "error_high", "brightness_without"])  # fmt: skip
        for row in report.effects:
            numbers = (row.cost_share, 1.0 - row.cost_high, 1.0 - row.cost_low, row.floor.error, row.floor.low,
                       row.floor.high, row.brightness)  # fmt: skip
            table.writerow([row.effect, *(f"{number:.6g}" for number in numbers)])

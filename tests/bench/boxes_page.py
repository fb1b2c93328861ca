"""What tests/bench/boxes.py measured: rows, and the table of docs/accuracy.md."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from support.pages import replace_between
from support.races import products_ratio

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "accuracy.md"
MOST_NOISE = 0.05  # of a converged picture, over the relMSE that is held against it
HEADINGS = ["box", "engine", "relMSE", "brightness %", "CPU ms a sample", "relMSE x s", "over Luch's"]


@dataclass
class Shots:
    """One engine in one box. Lists hold one value a turn."""

    noise: float  # relMSE of its converged picture
    energy: list[float] = field(default_factory=list)  # of that picture, over Luch's, by channel
    errors: list[float] = field(default_factory=list)  # relMSE
    seconds: list[float] = field(default_factory=list)  # CPU, of as many samples as a picture has
    brightness: list[float] = field(default_factory=list)

    @property
    def error(self) -> float:
        return float(np.mean(self.errors))

    @property
    def product(self) -> float:
        return self.error * float(np.median(self.seconds))


@dataclass
class Row:
    """One box."""

    box: str
    samples: int
    shots: dict[str, Shots]

    def cells(self) -> list[list[str]]:
        """A line for each engine."""
        return [self._line(name, shots) for name, shots in self.shots.items()]

    def _line(self, name: str, shots: Shots) -> list[str]:
        doubt = np.std(shots.errors) / np.sqrt(len(shots.errors))
        light = np.std(shots.brightness) / np.sqrt(len(shots.brightness))
        ratio = "1" if name == "Luch" else self._over_luch(shots)
        return [
            self.box, name, f"{shots.error:.5f} +- {doubt:.5f}",
            f"{100.0 * np.mean(shots.brightness):+.2f} +- {100.0 * light:.2f}",
            f"{1000.0 * np.median(shots.seconds) / self.samples:.1f}", f"{shots.product:.4f}", ratio,
        ]  # fmt: skip

    def _over_luch(self, shots: Shots) -> str:
        ours = self.shots["Luch"]
        ratio, low, high = products_ratio((shots.errors, shots.seconds), (ours.errors, ours.seconds))
        return f"{ratio:.2f} ({low:.2f} to {high:.2f})"


def table(rows: list[Row]) -> str:
    """One line a box and engine."""
    lines = [HEADINGS, ["---"] * len(HEADINGS), *(line for row in rows for line in row.cells())]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def report(rows: list[Row], what: dict[str, Any]) -> str:
    """The table and what it was made with."""
    noise = max(shots.noise / shots.error for row in rows for shots in row.shots.values())
    light = max(abs(ratio - 1.0) for row in rows for shots in row.shots.values() for ratio in shots.energy)
    head = (
        f"{what['size']} x {what['size']} pixels, {what['samples']} samples, {what['turns']} seeds, {what['bounces']} "
        f"bounces, threads: {what['threads'] or 'all'}; converged pictures of {what['reference']} samples, whose noise is "
        f"at most {noise:.1%} of a relMSE and whose channels agree within {light:.2%}; "
        f"{what['mitsuba'] or 'without Mitsuba'}; commit {what['commit'] or 'unknown'}"
    )
    return f"{head}\n\n{table(rows)}"


def read(files: list[Path]) -> tuple[list[Row], dict[str, Any]]:
    """Rows of calls with the same options. Raises ValueError where they are not the same."""
    told = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    if any(one["what"] != told[0]["what"] for one in told):
        raise ValueError("rows of other options do not belong into one table")
    rows = [
        Row(row["box"], row["samples"], {name: Shots(**shots) for name, shots in row["shots"].items()})
        for one in told
        for row in one["rows"]
    ]
    return rows, told[0]["what"]


def write(rows: list[Row], what: dict[str, Any]) -> None:
    """Puts them between the page's marks. Raises ValueError if it has none."""
    replace_between(PAGE, "boxes", report(rows, what))

"""What a report found, as plain data: what JSON holds, what tables, plots and sentences are made from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from luch.report.tally import Measured, NoiseLine

FILTER_AHEAD = 2.0
SCHEMA = 1  # of the JSON; raised when a name changes its meaning


@dataclass(frozen=True)
class Point:
    """Measured against the reference, the reference's noise taken out; mean over renders."""

    samples: int
    seconds: float  # of the small picture, building included
    error: float
    noise: float  # of one render, from the variance over seeds


@dataclass(frozen=True)
class Row:
    """One way to render, measured. Errors are fractions; seconds are those of the small picture unless said."""

    name: str
    group: str
    reason: str
    biased: bool  # it may be
    effect: str
    settings: Mapping[str, Any]
    renders: int
    samples: int
    build_seconds: float
    sample_seconds: float  # one sample of every pixel
    cost: float  # seconds of tracing over those of the scene as it is set, at as many samples
    cost_low: float
    cost_high: float
    points: list[Point]
    line: NoiseLine
    floor: Measured  # of the relMSE: from the exact picture, or for an effect from the scene as it is set
    brightness: float  # share by which the picture is brighter for the bias
    brightness_spread: float
    # Where noise is filtered out, bias falls with the samples, too: `line` is then that of both together, and `floor`
    # the bias at the samples that were taken.
    denoised: bool = False
    denoise_seconds: float = 0.0  # of the picture that the scene asks for

    @property
    def floor_relmse(self) -> float:
        """What it counts with: a bias that may be none is none."""
        return self.floor.value if self.floor.sure and not self.denoised else 0.0

    @property
    def floor_error(self) -> float:
        return math.sqrt(self.floor_relmse)

    @property
    def crossing_samples(self) -> float:
        """Where noise has fallen to the bias: from there more samples buy little. Infinite without bias."""
        return self.line.samples_for(self.floor_relmse)

    def error_at(self, samples: float) -> float:
        """Bias and noise together."""
        return math.sqrt(self.floor_relmse + self.line.relmse(max(samples, 1.0)))

    def samples_in(self, seconds: float, pixels: float = 1.0) -> float:
        """pixels: how many times those of the small picture."""
        left = seconds - self.build_seconds - self.denoise_seconds
        return left / (self.sample_seconds * pixels) if left > 0.0 else 0.0

    def seconds_of(self, samples: float, pixels: float) -> float:
        """Everything included."""
        return self.build_seconds + pixels * self.sample_seconds * samples + self.denoise_seconds

    def seconds_for(self, error: float, pixels: float = 1.0) -> float:
        """To an error, of a picture of so many times the pixels. Infinite below the floor, or where nothing that was
        measured says so."""
        rest = error * error - self.floor_relmse
        samples = max(1.0, self.line.samples_for(rest)) if rest > 0.0 else math.inf
        return self.seconds_of(samples, pixels) if samples <= self.known_until else math.inf

    @property
    def known_until(self) -> float:
        """Samples that its line reaches to. How fast the bias of a filter falls is not known beyond what was measured."""
        return FILTER_AHEAD * self.points[-1].samples if self.denoised else math.inf

    def at_taken(self) -> Point:
        """The point of the samples that its own renders took."""
        return next(point for point in self.points if point.samples == self.samples)

    @property
    def cost_share(self) -> float:
        """Of an effect that is left out here: its share of the time."""
        return 1.0 - self.cost


@dataclass
class Report:
    scene: str
    width: int  # of the small picture
    height: int
    full_width: int  # that the scene asks for
    full_height: int
    scene_samples: int
    device: str
    seconds_asked: float
    seconds: float
    reference_samples: int
    reference_error: float  # of the reference itself, by its two halves
    rows: list[Row]
    base: str  # name of the row of the scene as it is set
    absent: list[str] = field(default_factory=list)  # not tried, and why
    unmeasured: list[str] = field(default_factory=list)  # did not fit into the time
    warnings: list[str] = field(default_factory=list)
    cancelled: bool = False
    sentences: list[str] = field(default_factory=list)
    identity: str = ""  # of the scene (luch.identity); "": made before reports said it

    @property
    def pixels(self) -> float:
        """Of the picture that the scene asks for, over those of the small one."""
        return self.full_width * self.full_height / (self.width * self.height)

    def row(self, name: str) -> Row | None:
        return next((row for row in self.rows if row.name == name), None)

    @property
    def base_row(self) -> Row | None:
        return self.row(self.base)

    @property
    def choices(self) -> list[Row]:
        """Ways to render the same scene."""
        return [row for row in self.rows if not row.effect or not row.biased]

    @property
    def effects(self) -> list[Row]:
        """Effects left out, the dearest first."""
        return sorted((row for row in self.rows if row.effect), key=lambda row: row.cost)

    def as_dict(self) -> dict[str, Any]:
        """For JSON. Infinite numbers become null."""
        told = asdict(self)
        told["schema"] = SCHEMA
        for row, kept in zip(self.rows, told["rows"], strict=True):
            kept["settings"] = dict(row.settings)
            kept["floor_error"], kept["crossing_samples"] = row.floor_error, row.crossing_samples
            kept["floor_low"], kept["floor_high"] = row.floor.low, row.floor.high
        return dict(_finite(told))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def from_dict(told: Mapping[str, Any]) -> Report:
    """What `as_dict` gave. Raises ValueError for another schema."""
    if told.get("schema") != SCHEMA:
        raise ValueError(f"a report of schema {told.get('schema')}; this Luch reads {SCHEMA}: make the report again")
    derived = {"floor_error", "crossing_samples", "floor_low", "floor_high"}
    rows = []
    for kept in told["rows"]:
        plain = {key: value for key, value in kept.items() if key not in derived}
        plain["points"] = [Point(**point) for point in kept["points"]]
        plain["line"], plain["floor"] = NoiseLine(**kept["line"]), Measured(**kept["floor"])
        rows.append(Row(**plain))
    return Report(**{key: value for key, value in told.items() if key not in ("schema", "rows")}, rows=rows)

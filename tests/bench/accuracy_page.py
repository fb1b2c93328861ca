"""What tests/bench/accuracy.py measured: rows, tables for people, the file that several calls fill."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from support.checkout import commit
from support.pages import replace_between

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "out" / "bench" / "accuracy.json"
PAGE = ROOT / "docs" / "accuracy.md"
IN_BAND = 0.8, 1.25  # A2
MET = 0.7, 1.1  # A4, of errors
NEAR = np.log(0.8), np.log(1.2)  # A6
SAME_LIGHT = 1e-3  # A5, of the mean brightness


@dataclass
class Row:
    """One scene and sampler. Lists hold one value a render or a look."""

    scene: str
    sampler: str
    width: int
    height: int
    a2: list[tuple[int, float, float]] = field(default_factory=list)  # samples, claimed error, true error
    a2_covered: list[bool] = field(default_factory=list)
    a3: list[float] = field(default_factory=list)
    a3_width: float = 0.0
    a3_flagged: list[float] = field(default_factory=list)
    a3_gross: list[tuple[int, int]] = field(default_factory=list)  # flagged of those, all of them
    a4: list[float] = field(default_factory=list)
    a4_samples: list[int] = field(default_factory=list)
    a5: list[float] = field(default_factory=list)
    a6: list[tuple[float, bool]] = field(default_factory=list)  # log ratio; whether the interval held
    a6_far: list[tuple[float, bool]] = field(default_factory=list)
    a7: list[float] = field(default_factory=list)
    a8: list[float] = field(default_factory=list)
    adaptive: list[float] = field(default_factory=list)  # true over asked
    adaptive_samples: list[float] = field(default_factory=list)
    adaptive_brightness: list[float] = field(default_factory=list)
    cycles: list[dict[str, float]] = field(default_factory=list)

    @property
    def key(self) -> tuple[str, str]:
        return self.scene, self.sampler

    def cells_of_looks(self) -> list[str]:
        """For the table of --only-looks."""
        looks = f"{np.median(_ratios(self.a2) ** 2):.2f}; {_bands(self.a2)}; {np.mean(self.a2_covered):.0%}"
        return [self.scene, self.sampler, looks, _foretold(self.a6)]

    def cells(self) -> list[str]:
        """For the table."""
        scene, sampler, looks, foretold = self.cells_of_looks()
        return [
            scene,
            sampler,
            looks,
            f"{np.mean(self.a3):.1%}; {self.a3_width:.2f}; {np.mean(self.a3_flagged):.0%}; {_of(self.a3_gross)}",
            f"{np.median(self.a4):.2f}; {_within(self.a4, *MET)}; {np.median(self.a4_samples):.0f}",
            _per_cent(self.a5),
            foretold,
            _foretold(self.a6_far),
            f"{1000.0 * max(self.a7):.0f} ms",
            f"{np.median(self.a8):.3f}",
            f"{np.median(self.adaptive):.2f}; {np.median(self.adaptive_samples):.0f}; "
            f"{_per_cent(self.adaptive_brightness)}",
        ]


def _within(values: Any, low: float, high: float) -> str:
    values = np.asarray(values)
    return f"{np.mean((values >= low) & (values <= high)):.0%}"


def _ratios(looks: list[tuple[int, float, float]]) -> Any:
    return np.array([told / true for _, told, true in looks])


def _bands(looks: list[tuple[int, float, float]]) -> str:
    """Of errors, and of their squares."""
    return f"{_within(_ratios(looks), *IN_BAND)}, {_within(_ratios(looks) ** 2, *IN_BAND)}"


def _cases(rows: list[Row]) -> str:
    """Of the mean squares over seeds, at each number of samples."""
    found: dict[tuple[str, str, int], list[tuple[float, float]]] = {}
    for row in rows:
        for samples, told, true in row.a2:
            found.setdefault((*row.key, samples), []).append((told * told, true * true))
    return _within([np.divide(*np.mean(pairs, axis=0)) for pairs in found.values()], *IN_BAND)


def _of(counted: Iterable[tuple[int, int]]) -> str:
    found, all_of_them = (sum(part) for part in zip(*counted, strict=True))
    return f"{found} of {all_of_them}"


def _foretold(pairs: list[tuple[float, bool]]) -> str:
    off = np.array([ratio for ratio, _ in pairs])
    return f"{np.median(np.abs(off)):.2f}; {_within(off, *NEAR)}; {np.mean([held for _, held in pairs]):.0%}"


def _uncertain(values: Any) -> tuple[float, float]:
    """Mean and its standard error."""
    return float(np.mean(values)), float(np.std(values) / np.sqrt(len(values)))


def _per_cent(values: Any) -> str:
    mean, doubt = _uncertain(values)
    return f"{100.0 * mean:+.2f} +- {100.0 * doubt:.2f}"


HEADINGS = ["scene", "sampler", "A2 squared ratio; in band: error, squared; covered", "A3 covered; width; flagged; gross misses flagged", "A4 true/asked; in band; samples", "A5 brightness %",
            "A6 x4: log ratio; in 20 %; covered", "A6 x16", "A7 over", "A8 cost", "adaptive: true/asked; samples; brightness %"]  # fmt: skip
LOOKS_HEADINGS = ["scene", "sampler", HEADINGS[2], HEADINGS[6]]
CYCLES_HEADINGS = ["scene", "noise threshold", "Cycles: true error %; s; brightness %",
                   "Luch asked for that: true error %; s; brightness %", "energy, Cycles over Luch"]  # fmt: skip
SUMMARY_HEADINGS = ["all scenes", "rows", "A2 in band (goal 90 %): error, squared, cases; covered (95 %)", "A3 covered; width (2.6); gross misses flagged (80 %)",
                    "A4 met (90 %)", "A5 brightness %; rows within 0.1 %; within 2 standard errors", "A6 x4: log ratio (0.10); in 20 % (90 %); covered (80 %)", "A6 x16: in 20 % (80 %)", "A8 cost (1.03)"]  # fmt: skip


def _lines(headings: list[str], rows: Iterable[list[str]]) -> str:
    return "\n".join(["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings),
                      *("| " + " | ".join(row) + " |" for row in rows)])  # fmt: skip


def table(rows: list[Row]) -> str:
    """Every row that was measured whole."""
    return _lines(HEADINGS, (row.cells() for row in rows))


def looks_table(rows: list[Row]) -> str:
    """Rows of --only-looks, and what they come to."""
    told = [row.cells_of_looks() for row in rows]
    for name, own in _by_sampler(rows):
        looks = [look for row in own for look in row.a2]
        held = np.mean([held for row in own for held in row.a2_covered])
        squared = np.median(_ratios(looks) ** 2)
        told.append([
            "all", name, f"{squared:.2f}; {_bands(looks)}; {held:.0%} (cases: {_cases(own)})",
            _foretold([pair for row in own for pair in row.a6]),
        ])  # fmt: skip
    return _lines(LOOKS_HEADINGS, told)


def cycles_table(rows: list[Row]) -> str:
    """Cycles' noise threshold, where it was measured; "" where it was not."""
    told = []
    for row in rows:
        for one in row.cycles:
            sides = [
                f"{100 * one[f'{who}error']:.2f}; {one[f'{who}seconds']:.1f}; {100 * one[f'{who}brightness']:+.2f}"
                for who in ("", "luch_")
            ]
            told.append([row.scene, f"{one['threshold']:g}", *sides, f"{one['energy']:.4f}"])
    return _lines(CYCLES_HEADINGS, told) if told else ""


def summary(rows: list[Row]) -> str:
    """The goals' rows A2 to A6 over all scenes, one line a sampler and one for all."""
    return _lines(SUMMARY_HEADINGS, (_summed(name, own) for name, own in _by_sampler(rows)))


def _by_sampler(rows: list[Row]) -> list[tuple[str, list[Row]]]:
    samplers = list(dict.fromkeys(row.sampler for row in rows))
    groups = [(sampler, [row for row in rows if row.sampler == sampler]) for sampler in samplers]
    return [*groups, ("all", rows)] if len(samplers) > 1 else groups


def _summed(name: str, rows: list[Row]) -> list[str]:
    def together(of: Callable[[Row], list[Any]]) -> Any:
        return np.concatenate([of(row) for row in rows])

    light = [_uncertain(row.a5) for row in rows]
    same = sum(abs(mean) <= SAME_LIGHT for mean, _ in light)
    unbiased = sum(abs(mean) <= 2.0 * doubt for mean, doubt in light)
    return [
        name,
        str(len(rows)),
        f"{_bands([look for row in rows for look in row.a2])}, {_cases(rows)}; "
        f"{np.mean(together(lambda row: row.a2_covered)):.0%}",
        f"{np.mean(together(lambda row: row.a3)):.1%}; {np.median([row.a3_width for row in rows]):.2f}; "
        f"{_of([pair for row in rows for pair in row.a3_gross])}",
        _within(together(lambda row: row.a4), *MET),
        f"{_per_cent([mean for mean, _ in light])}; {same} of {len(rows)}; {unbiased} of {len(rows)}",
        _foretold([pair for row in rows for pair in row.a6]),
        _foretold([pair for row in rows for pair in row.a6_far]),
        f"{np.median([np.median(row.a8) for row in rows]):.3f}",
    ]


def report(rows: list[Row], what: dict[str, Any]) -> str:
    """Everything, for the page."""
    own, looks = [row for row in rows if row.a4], [row for row in rows if row.a2 and not row.a4]
    tables = [table(own), summary(own)] if own else []
    if looks:
        tables.append(looks_table(looks))
    return "\n\n".join(part for part in (_head(what), *tables, cycles_table(rows)) if part)


def _head(what: dict[str, Any]) -> str:
    return (f"{what['size']} pixels wide, {what['seeds']} seeds, reference of {what['reference']} samples, "
            f"{what['device']}, {what['processors']} processors, commit {what['commit'] or 'unknown'}")  # fmt: skip


def write_page_from(files: list[Path]) -> None:
    """The page of what several calls kept: rows of the same options in one table, the others below."""
    groups: dict[str, tuple[dict[str, Any], list[Row]]] = {}
    for file in files:
        told = json.loads(file.read_text(encoding="utf-8"))
        _, rows = groups.setdefault(_head(told["what"]), (told["what"], []))
        rows += [Row(**row) for row in told["rows"]]
    for _, rows in groups.values():
        rows.sort(key=lambda row: row.scene)
    replace_between(PAGE, "accuracy", "\n\n".join(report(rows, what) for what, rows in groups.values()))


class Kept:
    """out/bench/accuracy.json: rewritten after every row, so that a call that is cut off loses one row."""

    def __init__(self, options: dict[str, Any], append: bool) -> None:
        """options: what rows of one table have in common."""
        self.what = options | {"code": _code(), "commit": commit(), "processors": len(os.sched_getaffinity(0))}
        self.rows: list[Row] = []
        if append and FILE.exists():
            self._load(json.loads(FILE.read_text(encoding="utf-8")))

    def _load(self, told: dict[str, Any]) -> None:
        other = [key for key in self.what if key != "commit" and told["what"].get(key) != self.what[key]]
        if other:
            print(f"{len(told['rows'])} rows of {FILE} are dropped: they have another {', another '.join(other)}.")
            return
        self.rows = [Row(**row) for row in told["rows"]]

    def has(self, scene: str, sampler: str) -> bool:
        return any(row.key == (scene, sampler) for row in self.rows)

    def has_cycles(self, scene: str) -> bool:
        return any(row.scene == scene and row.cycles for row in self.rows)

    def add(self, row: Row) -> None:
        """And writes, whole or not at all."""
        self.rows.append(row)
        FILE.parent.mkdir(parents=True, exist_ok=True)
        beside = FILE.with_suffix(".part")
        told = {"what": self.what, "rows": [asdict(one) for one in self.rows]}
        beside.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        beside.replace(FILE)

    def write_page(self) -> None:
        """Puts the tables into docs."""
        replace_between(PAGE, "accuracy", report(self.rows, self.what))


def _code() -> str:
    """What was measured, where a copy has no history: a hash of the sources."""
    mixed = hashlib.sha256()
    folders = [ROOT / "native", ROOT / "addon"]
    files = [file for folder in folders for kind in ("py", "h", "cpp", "cu") for file in folder.rglob(f"*.{kind}")]
    for file in sorted(files):
        mixed.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return mixed.hexdigest()[:16]

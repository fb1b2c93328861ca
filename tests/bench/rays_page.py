"""The measured parts of docs/rays.md: tables and a plot from the race's rows, each between two marks in the page."""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
from luch.bench.rays import KINDS
from support.pages import replace_between

mpl.use("Agg")
import matplotlib.pyplot as plt

Rows = list[dict[str, Any]]
ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "rays.md"
CUDA_RECORD = ROOT / "tests" / "bench" / "records" / "rays-cuda.json"  # by `python -m luch bench rays --device cuda`


def write_page(rows: list[dict[str, Any]], means: dict[str, dict[str, float]]) -> None:
    """The CPU's race. Raises ValueError if the page has no marks for it."""
    columns = ["build, ms/Mtri", "bytes/triangle", "nodes, tests of a diffuse ray"]
    parts = [_where(), *_tables(rows, columns, _lines_of_race), _means(means), "![Mrays/s by structure](rays.png)"]
    replace_between(PAGE, "race", "\n\n".join(parts))
    _plot(rows)


def write_cuda_part() -> None:
    """The GPU's race, out of the record of its last run."""
    record = json.loads(CUDA_RECORD.read_text(encoding="utf-8"))
    machine, rows = record["machine"], record["rows"]
    where = (f"Measured on one {machine['device']}, driver {machine['cuda_driver']}, {record['date']}, "
             f"commit {record['commit']}, {record['rays']:,} rays a launch.")  # fmt: skip

    def lines_of(own: Rows) -> Iterator[list[str]]:
        for name in dict.fromkeys(row["structure"] for row in own):
            by_rays = {row["rays"]: row for row in own if row["structure"] == name}
            rates = [f"{by_rays[kind]['mrays_per_s']:,.4g}" if kind in by_rays else "" for kind in KINDS]
            one = by_rays["diffuse"]
            yield [name, *rates, str(one["registers"]), f"{one['occupancy']:.2f}",
                   f"{one['nodes']:.1f}, {one['primitives']:.1f}", f"{one['bytes_per_triangle']:.0f}"]  # fmt: skip

    columns = ["registers", "occupancy", "nodes, tests of a diffuse ray", "bytes/triangle"]
    replace_between(PAGE, "cuda", "\n\n".join([where, *_tables(rows, columns, lines_of)]))


def _where() -> str:
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True,
                            check=True).stdout.strip()  # fmt: skip
    names = [line.partition(":")[2].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
             if line.startswith("model name")]  # fmt: skip
    return f"Measured on {names[0] if names else platform.processor()}, one thread, commit {commit}."


def _lines_of_race(own: Rows) -> Iterator[list[str]]:
    for row in own:
        work = f"{row['diffuse_nodes']:.1f}, {row['diffuse_tests']:.1f}" if "diffuse_nodes" in row else ""
        rates = [f"{row[kind]:.3g}" for kind in KINDS]
        yield [row["contestant"], *rates, f"{row['build_ms_per_mtri']:.0f}", f"{row['bytes_per_triangle']:.0f}", work]


def _tables(rows: Rows, columns: list[str], lines_of: Callable[[Rows], Iterable[list[str]]]) -> list[str]:
    """One table a mesh: a structure's name, its rates by kind of ray, then the columns named."""
    tables = []
    for mesh in dict.fromkeys(row["mesh"] for row in rows):
        own = [row for row in rows if row["mesh"] == mesh]
        table = _table(["structure", *(f"{kind}, Mrays/s" for kind in KINDS), *columns], lines_of(own))
        tables.append(f"**{mesh}**, {own[0]['triangles']:,} triangles\n\n{table}")
    return tables


def _table(head: list[str], lines: Iterable[list[str]]) -> str:
    """In Markdown, all columns but the first right-aligned."""
    rule = "|---|" + "---:|" * (len(head) - 1)
    return "\n".join([_line(head), rule, *map(_line, lines)])


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _means(means: dict[str, dict[str, float]]) -> str:
    said = "Geometric means over the meshes (rates: above 1 the first is faster; build: below 1 it is):"
    lines = ([name, *(f"{value:.2f}" for value in row.values())] for name, row in means.items())
    return said + "\n\n" + _table(["ratio", *KINDS, "build"], lines)


def _plot(rows: list[dict[str, Any]]) -> None:
    """One panel a mesh, one bar a structure and kind of ray, logarithmic."""
    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    figure, axes = plt.subplots(1, len(meshes), figsize=(4.2 * len(meshes), 4.6), sharey=True, squeeze=False)
    for axis, mesh in zip(axes[0], meshes, strict=True):
        own = [row for row in rows if row["mesh"] == mesh][::-1]
        for k, kind in enumerate(KINDS):
            axis.barh([i - 0.2 * k for i in range(len(own))], [row[kind] for row in own], height=0.18, label=kind)
        axis.set_yticks([i - 0.3 for i in range(len(own))], [row["contestant"] for row in own], fontsize=8)
        axis.set_xscale("log")
        axis.set_xlabel("Mrays/s, one thread")
        axis.set_title(f"{mesh}, {own[0]['triangles']:,} triangles", fontsize=10)
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(PAGE.with_name("rays.png"), dpi=110)

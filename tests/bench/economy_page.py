"""The measured tables of docs/effects.md, from the records of both devices."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from support.pages import replace_between

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "effects.md"
DEVICES = ("CPU", "CUDA")
TITLES = {"idle": "**{}: what is idle, simulated all the same.** Time over that of the scene's own plan, with a 95 % "
          "interval; bytes and code beside those of the plan.",
          "left out": "**{}: what is there, left out.** Time over that of the whole scene; how much the picture changes, "
          "noise included.",
          "moving": "**{}: what moves.** Time over that of the same scene when all stands still; how much the picture "
          "changes. *hidden*: one that no ray can meet; *clear*: it stands still and lets light through, beside one that "
          "does not."}  # fmt: skip


def record_of(device: str) -> Path:
    """Where a device's rows are kept."""
    return ROOT / "tests" / "bench" / "records" / f"economy-{device.lower()}.json"


def write() -> None:
    """Puts the tables between the page's marks. Raises ValueError if it has none."""
    records = {device: json.loads(record_of(device).read_text(encoding="utf-8"))
               for device in DEVICES if record_of(device).exists()}  # fmt: skip
    parts = [f"{device}: commit {', '.join(sorted(_commits(record)))}." for device, record in records.items()]
    for scene in dict.fromkeys(scene for record in records.values() for scene in record):
        for kind, title in TITLES.items():
            rows = {device: record.get(scene, {}).get(kind, {}) for device, record in records.items()}
            names = list(dict.fromkeys(name for own in rows.values() for name in own))
            if names:
                parts += [title.format(scene), "\n".join(_table(kind, names, rows))]
    replace_between(PAGE, "economy", "\n\n".join(parts))


def _commits(record: dict[str, Any]) -> set[str]:
    return {row["commit"] for scene in record.values() for rows in scene.values() for row in rows.values()}


def _table(kind: str, names: list[str], rows: dict[str, dict[str, Any]]) -> list[str]:
    columns = [f"{device}: {what}" for device in rows for what in ("time", "more" if kind == "idle" else "picture")]
    lines = ["| effect | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for name in names:
        cells = [cell for own in rows.values() for cell in _cells(kind, own.get(name))]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _cells(kind: str, row: dict[str, Any] | None) -> tuple[str, str]:
    if row is None:
        return "", ""
    time = f"{row['ratio']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
    if kind != "idle":
        return time, f"relMSE {row['difference']:.2g}"
    told = [] if row["same_bits"] else ["**other bits**"]
    told += [f"{change:+,} {field.replace('_', ' ')}" for field, change in row["bytes"].items()]
    before, after = row["code"]
    if after:
        told += [f"{after[field]:.0f} {what} (plan {before[field]:.0f})" for field, what in _CODE.items()
                 if after[field] != before[field]]  # fmt: skip
    return time, "; ".join(told)


_CODE = {"registers": "registers", "local_bytes": "local bytes", "code_bytes": "bytes of code"}

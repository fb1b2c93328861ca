"""Where a render's statistics go: a line for people, header fields of pictures, a JSON file for farms."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from luch import adaptive, ledger
from luch.accuracy import percent
from luch.curve import describe

# Why a render ended, as people read it.
ENDS = {
    "samples": "all samples taken",
    "time": "time limit reached",
    "error": "error reached",
    "cancel": "cancelled",
}


def line(stats: Mapping[str, Any]) -> str:
    """ "128 samples in 12.3 s, error 1.8 % (1.7 to 1.9 %); 1 % would take 41 s (34 to 52 s) more; time limit reached"."""
    text = f"{stats.get('samples', 0)} samples in {stats.get('render_seconds', 0.0):.2f} s"
    if "error" in stats:
        text += f", {describe(stats)}"
    if stats.get("stopped_by") in ENDS:
        text += f"; {ENDS[stats['stopped_by']]}"
    text += "".join(f"; {note[0].lower()}{note[1:]}" for note in notes(stats))
    if "verified" in stats:
        text += f"; {verdict(stats['verified'])}"
    return text


def notes(stats: Mapping[str, Any]) -> list[str]:
    """What else a reader of the error should know, one sentence each."""
    told = [stats["quality"]["reason"]] if "quality" in stats else []
    if where := adaptive.line(stats):
        told.append(where[:1].upper() + where[1:])
    if stats.get("denoised"):
        told.append("Denoised: the error is that of the picture before")
    return told + ledger.lines(stats)


def verdict(found: Mapping[str, Any]) -> str:
    """ "verified: claimed 1.8 %, two halves say 1.7 %: the claim holds"."""
    word = "the claim holds" if found["holds"] else "THE CLAIM DOES NOT HOLD"
    return f"verified: claimed {percent(found['claimed'])} %, two halves say {percent(found['observed'])} %: {word}"


def header_fields(stats: Mapping[str, Any]) -> dict[str, str | int | float]:
    """Statistics as header fields of a picture: plain values as they are, others as JSON."""
    from luch.effects import summary  # loads the core: not while Blender starts

    fields: dict[str, str | int | float] = {}
    for key, value in stats.items():
        if key == "effects":  # their reasons would outweigh all the rest
            value = summary(value)
        plain = isinstance(value, str | int | float) and not isinstance(value, bool)
        # A header's integers have 32 bits.
        if plain and not (isinstance(value, int) and abs(value) >= 2**31):
            fields[f"luch.{key}"] = value
        else:
            fields[f"luch.{key}"] = json.dumps(value, default=str)
    return fields


def write_json(path: str | os.PathLike[str], stats: Mapping[str, Any]) -> None:
    """Everything known, readable whenever it is there: written beside and moved into place. Raises OSError."""
    target = Path(path)
    beside = target.with_name(f"{target.name}.{os.getpid()}.part")
    beside.write_text(json.dumps(stats, indent=1, default=str) + "\n", encoding="utf-8")
    beside.replace(target)

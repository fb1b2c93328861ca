"""The checkout that a test or a bench runs in, and processes of its own with the add-on in them."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def commit() -> str:
    """Of the checkout; of a copy without history what stands in its file COMMIT, or nothing."""
    told = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True,
                          check=False).stdout.strip()  # fmt: skip
    beside = ROOT / "COMMIT"
    return told or (beside.read_text(encoding="utf-8").strip() if beside.exists() else "")


def environment() -> dict[str, str]:
    """For a process with bpy and the add-on."""
    paths = [str(ROOT), str(ROOT / "native"), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}

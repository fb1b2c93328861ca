"""Where things are. Everything generated lies under one of these."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
VENV_PYTHON = VENV / "bin" / "python"
NATIVE = ROOT / "native"
BUILD = ROOT / ".build"
OUT = ROOT / "out"
DIST = ROOT / "dist"


def tool(name: str) -> str:
    """Path of a program that pip put into .venv."""
    return str(VENV / "bin" / name)

"""Finds a Python 3.13 and makes .venv with the pinned requirements; skips what is already right."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from pathlib import Path
from typing import Iterator, Optional, Tuple

from buildtools.failure import BuildFailure
from buildtools.places import ROOT, VENV, VENV_PYTHON
from buildtools.run import output, require

WANTED = (3, 13)  # Blender 5.1 and 5.2 carry this Python, and bpy's wheels are made for it
HOW_TO_GET_IT = (
    "no Python 3.13 found on PATH, in pyenv's versions or through uv; get one with `uv python install 3.13`, "
    "`pyenv install 3.13` or your system's packages (python3.13 and python3.13-venv), then run this again"
)


def ensure_environment() -> None:
    """After this, .venv holds exactly what requirements.txt pins."""
    stamp = VENV / "luch-requirements.sha256"
    requirements = ROOT / "requirements.txt"
    digest = hashlib.sha256(requirements.read_bytes()).hexdigest()
    if VENV_PYTHON.exists() and stamp.exists() and stamp.read_text() == digest:
        return
    if _version(str(VENV_PYTHON)) != WANTED:
        _make_venv()
    print("installing the pinned requirements into .venv (bpy is about 400 MB)", flush=True)
    pip = [str(VENV_PYTHON), "-m", "pip", "install", "-qq", "--disable-pip-version-check"]
    require(
        [*pip, "--no-deps", "-r", str(requirements)],  # every package is pinned: nothing is left to resolve
        "the requirements could not be installed; see pip's message above",
    )
    stamp.write_text(digest)


def _make_venv() -> None:
    python = _find_python()
    if python is None:
        raise BuildFailure(HOW_TO_GET_IT)
    print(f"making .venv with {python}", flush=True)
    if VENV.is_symlink():
        VENV.unlink()
    elif VENV.exists():
        shutil.rmtree(VENV)
    require(
        [python, "-m", "venv", str(VENV)], "the virtual environment could not be made; is the venv module installed?"
    )


def _find_python() -> Optional[str]:
    for candidate in _candidates():
        if _version(candidate) == WANTED:
            return candidate
    uv = shutil.which("uv")
    if uv:
        require([uv, "python", "install", "3.13"], "uv could not install a Python 3.13")
        return output([uv, "python", "find", "3.13"])
    return None


def _candidates() -> Iterator[str]:
    yield sys.executable
    on_path = shutil.which("python3.13")
    if on_path:
        yield on_path
    pyenv_root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    for folder in sorted(pyenv_root.glob("versions/3.13*"), reverse=True):
        yield str(folder / "bin" / "python")
    uv = shutil.which("uv")
    found = output([uv, "python", "find", "3.13"]) if uv else None
    if found:
        yield found


def _version(python: str) -> Optional[Tuple[int, ...]]:
    """(major, minor) of an interpreter, or None when it does not run."""
    text = output([python, "-c", "import sys; print(*sys.version_info[:2])"])
    return tuple(int(part) for part in text.split()) if text else None

"""Compiles native/ with CMake and ninja, incrementally, into native/luch/_core_*.so."""

from __future__ import annotations

import os
import runpy
import shutil
from pathlib import Path
from typing import List

from buildtools.failure import BuildFailure
from buildtools.places import BUILD, NATIVE, ROOT, VENV_PYTHON, tool
from buildtools.run import output, require

SANITIZE_BUILD = ROOT / ".build-sanitize"


def compile_core(isas: str = "v2;v3;v4", jobs: int = 0) -> None:
    """isas: semicolon-separated x86-64 levels. jobs: 0 means one per core. Raises BuildFailure."""
    _require_compiler()
    configure_and_make(BUILD, core_options(isas, str(VENV_PYTHON)), jobs)
    for stale in (NATIVE / "luch").glob("_core_*.so"):
        # A core of an earlier, wider build would be loaded on another processor, and be of another version.
        if stale.name.split(".")[0] not in [f"_core_{isa}" for isa in isas.split(";")]:
            stale.unlink()


def levels(isas: str) -> str:
    """Semicolon-separated x86-64 levels; "here" is the plain one and the best one that this processor runs."""
    if isas != "here":
        return isas
    best: str = runpy.run_path(str(NATIVE / "luch" / "_native.py"))["levels_here"]()[0]
    return ";".join(sorted({"v2", best}))


def compile_sanitized(jobs: int = 0) -> Path:
    """The plain core with AddressSanitizer and UBSan, beside a copy of the Python package: the folder to import from."""
    _require_compiler()
    package = SANITIZE_BUILD / "package" / "luch"
    options = [*core_options("v3", str(VENV_PYTHON)), "-DLUCH_SANITIZE=ON", f"-DLUCH_OUTPUT_DIR={package}"]
    configure_and_make(SANITIZE_BUILD, options, jobs)
    shutil.copytree(NATIVE / "luch", package, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    return package.parent


def _require_compiler() -> None:
    if not (shutil.which("c++") or os.environ.get("CXX")):
        raise BuildFailure("no C++ compiler found; install one that knows C++20 (e.g. the package g++, 12 or later)")


def core_options(isas: str, python: str) -> List[str]:
    """CMake's -D options that decide what is compiled; python: the interpreter it is for."""
    options = [
        f"-DLUCH_ISAS={isas}",
        "-DLUCH_WARNINGS_AS_ERRORS=ON",
        f"-DPython_EXECUTABLE={python}",
        f"-Dpybind11_DIR={output([str(VENV_PYTHON), '-m', 'pybind11', '--cmakedir'])}",
    ]
    ccache = shutil.which("ccache")
    return [*options, f"-DCMAKE_CXX_COMPILER_LAUNCHER={ccache}"] if ccache else options


def configure_and_make(folder: Path, options: List[str], jobs: int) -> None:
    """Runs CMake when the options are others than last time, then ninja."""
    options = [*options, f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"]
    record = folder / "luch-options.txt"
    wanted = "\n".join(options)
    # ninja itself runs CMake again when a CMakeLists.txt or the list of sources changes.
    if not ((folder / "build.ninja").exists() and record.exists() and record.read_text() == wanted):
        require(
            [tool("cmake"), "-S", str(NATIVE), "-B", str(folder), "-G", "Ninja", *options],
            "CMake could not configure native/",
        )
        record.write_text(wanted)
    require(
        [tool("cmake"), "--build", str(folder), "-j", str(jobs or os.cpu_count() or 1)],
        "the core did not compile; the compiler's first error is above",
    )

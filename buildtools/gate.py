"""The gate: every check that needs no test run, cheap to dear, stopping at the first red one."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Callable, List, Tuple

from buildtools.failure import BuildFailure
from buildtools.kernels import check_kernels
from buildtools.places import BUILD, NATIVE, ROOT, VENV_PYTHON, tool
from buildtools.run import require

TYPED = ["build.py", "buildtools", "addon", "native/luch"]


def run_gate() -> int:
    """0 when every check is green; raises BuildFailure at the first red one."""
    for name, run in CHECKS:
        started = time.monotonic()
        print(f"-- {name}", flush=True)
        run()
        print(f"   {time.monotonic() - started:.1f} s", flush=True)
    return 0


def _files(*suffixes: str) -> List[str]:
    """Every tracked or new (not ignored) file with one of the suffixes."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return sorted(name for name in listing.stdout.splitlines() if name.endswith(suffixes) and (ROOT / name).exists())


def _format_python() -> None:
    require([tool("ruff"), "format", "--check", "--diff", "."], "run `.venv/bin/ruff format .`")


def _lint_python() -> None:
    require([tool("ruff"), "check", "."], "ruff found faults; `.venv/bin/ruff check --fix .` mends the simple ones")


def _format_cpp() -> None:
    sources = _files(".h", ".cpp", ".cu", ".cuh")
    require([tool("clang-format"), "--dry-run", "-Werror", *sources], "run `.venv/bin/clang-format -i` on these files")


def _spelling() -> None:
    require([tool("codespell"), *_files(".py", ".h", ".cpp", ".cu", ".md", ".txt", ".toml")], "misspelt words")


def _architecture() -> None:
    require([str(VENV_PYTHON), "-m", "pytest", "-q", "tests/test_architecture.py"], "who may know whom was broken")


def _types() -> None:
    require([tool("mypy"), *[name for name in TYPED if (ROOT / name).exists()]], "mypy found faults")


def _headers_alone() -> None:
    """Each device-visible header compiles by itself: what it uses, it includes."""
    flags = ["-std=gnu++20", "-march=x86-64-v3", "-I", str(NATIVE / "include"), "-Wall", "-Wextra", "-Werror"]
    _compile_each(lambda source, _: ["c++", *flags, "-fsyntax-only", source], "headers-cpp", ".cpp")


def _headers_cuda() -> None:
    """The same headers through nvcc, which needs no GPU. Left out where there is no nvcc, and said so."""
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        print("   left out: no nvcc on PATH")
        return
    flags = ["-std=c++20", "-I", str(NATIVE / "include"), "-arch=sm_75", "--fmad=false", "-ptx"]
    _compile_each(lambda source, target: [nvcc, *flags, source, "-o", target + ".ptx"], "headers-cuda", ".cu")


def _compile_each(command: Callable[[str, str], List[str]], folder_name: str, suffix: str) -> None:
    """Compiles a one-line source per header; command(source, target without suffix) says how."""
    folder = BUILD / folder_name
    folder.mkdir(parents=True, exist_ok=True)

    def failure(header: Path) -> str:
        include = header.relative_to(NATIVE / "include").as_posix()
        source = folder / (include.replace("/", "_") + suffix)
        source.write_text(f'#include "{include}"\n')
        result = subprocess.run(command(str(source), str(source)), capture_output=True, text=True, check=False)
        return "" if result.returncode == 0 else f"{include}:\n{(result.stdout + result.stderr)[:4000]}"

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        failures = [text for text in pool.map(failure, sorted((NATIVE / "include").rglob("*.h"))) if text]
    if failures:
        print("\n".join(failures))
        raise BuildFailure(f"{len(failures)} headers do not compile alone")


CHECKS: List[Tuple[str, Callable[[], None]]] = [
    ("format: ruff", _format_python),
    ("format: clang-format", _format_cpp),
    ("lint: ruff", _lint_python),
    ("spelling: codespell", _spelling),
    ("architecture: who imports whom, who includes whom", _architecture),
    ("types: mypy --strict", _types),
    ("headers alone: c++", _headers_alone),
    ("headers alone: nvcc", _headers_cuda),
    ("kernels: nvcc, every architecture", check_kernels),
]

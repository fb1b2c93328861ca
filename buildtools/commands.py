"""One function per command of build.py. Each takes argparse's result and returns an exit status."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import List

from buildtools.compile_core import compile_core
from buildtools.failure import BuildFailure
from buildtools.places import DIST, NATIVE, OUT, ROOT, VENV, VENV_PYTHON
from buildtools.run import status
from buildtools.setup_venv import ensure_environment

Arguments = argparse.Namespace


def _prepare(arguments: Arguments) -> None:
    ensure_environment()
    compile_core(arguments.isa, arguments.jobs)


def setup(arguments: Arguments) -> int:
    ensure_environment()
    print(f"ready: {VENV_PYTHON}")
    return 0


def build(arguments: Arguments) -> int:
    ensure_environment()
    compile_core(arguments.isa, arguments.jobs, arguments.sanitize)
    return 0


def render(arguments: Arguments) -> int:
    if arguments.file is not None:
        _require_file(arguments.file)
    if arguments.output and Path(arguments.output).suffix not in (".exr", ".png"):
        raise BuildFailure(f"--output {arguments.output}: only .exr (multilayer) and .png can be written")
    _prepare(arguments)
    return _inside_blender(
        "render", arguments, ["file", "samples", "time", "seed", "frame", "scale", "output", "engine"]
    )


def export(arguments: Arguments) -> int:
    _require_file(arguments.file)
    _prepare(arguments)
    return _inside_blender("export", arguments, ["file", "output", "frame"])


def test(arguments: Arguments) -> int:
    _prepare(arguments)
    return status([str(VENV_PYTHON), "-m", "pytest", *arguments.rest])


def bench(arguments: Arguments) -> int:
    folder = ROOT / "tests" / "bench"
    names = sorted(path.stem for path in folder.glob("*.py") if not path.stem.startswith("_"))
    if arguments.name is None:
        print("benches:", ", ".join(names))
        return 0
    if arguments.name not in names:
        raise BuildFailure(f"no bench named {arguments.name}; there are: {', '.join(names)}")
    _prepare(arguments)
    return status([str(VENV_PYTHON), str(folder / f"{arguments.name}.py"), *arguments.rest])


def check(arguments: Arguments) -> int:
    from buildtools.gate import run_gate

    ensure_environment()
    return run_gate()


def package(arguments: Arguments) -> int:
    from buildtools.package import build_extension

    _prepare(arguments)  # the wheel is made from the same compilation
    print(build_extension([python for python in arguments.python.split(",") if python], arguments.isa))
    return 0


def clean(arguments: Arguments) -> int:
    folders = [*ROOT.glob(".build*"), OUT, DIST, *([VENV] if arguments.all else [])]
    caches = [ROOT / ".pytest_cache", ROOT / ".mypy_cache", ROOT / ".ruff_cache", *ROOT.glob("*/**/__pycache__")]
    for path in folders + [cache for cache in caches if VENV not in cache.parents]:
        shutil.rmtree(path, ignore_errors=True)
    for library in (NATIVE / "luch").glob("_core_*.so"):
        library.unlink()
    return 0


def _require_file(path: str) -> None:
    if not Path(path).is_file():
        raise BuildFailure(f"{path}: no such file")


def _inside_blender(job: str, arguments: Arguments, names: List[str]) -> int:
    """Runs buildtools/inside/JOB.py in .venv, where bpy is; its one argument is a JSON object."""
    options = {name: getattr(arguments, name) for name in names}
    for name in ("file", "output"):  # the child runs in ROOT: make the caller's paths absolute
        if options.get(name):
            options[name] = str(Path(options[name]).resolve())
    return status([str(VENV_PYTHON), "-m", f"buildtools.inside.{job}", json.dumps(options)])

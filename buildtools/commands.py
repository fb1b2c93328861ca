"""One function per command of build.py. Each takes argparse's result and returns an exit status."""

from __future__ import annotations

import argparse
import json
import os
import shutil
from pathlib import Path
from typing import Dict, List

from buildtools.compile_core import compile_core, compile_sanitized
from buildtools.failure import BuildFailure
from buildtools.kernels import AHEAD, place_kernels
from buildtools.places import DIST, NATIVE, OUT, ROOT, VENV, VENV_PYTHON
from buildtools.run import output, status
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
    compile_core(arguments.isa, arguments.jobs)
    if arguments.cuda:
        place_kernels()
    return 0


def render(arguments: Arguments) -> int:
    if arguments.file is not None:
        _require_file(arguments.file)
    if arguments.output and Path(arguments.output).suffix not in (".exr", ".png"):
        raise BuildFailure(f"--output {arguments.output}: only .exr (multilayer) and .png can be written")
    _prepare(arguments)
    return _inside_blender(
        "render",
        arguments,
        ["file", "samples", "time", "error", "verify", "seed", "frame", "scale", "output", "engine"],
    )


def report(arguments: Arguments) -> int:
    if arguments.file is not None:
        _require_file(arguments.file)
    if not arguments.seconds > 0:
        raise BuildFailure(f"--seconds {arguments.seconds:g}: a report needs time")
    _prepare(arguments)
    return _inside_blender("report", arguments, ["file", "seconds", "size", "frame", "output"])


def export(arguments: Arguments) -> int:
    _require_file(arguments.file)
    _prepare(arguments)
    return _inside_blender("export", arguments, ["file", "output", "frame"])


def test(arguments: Arguments) -> int:
    if arguments.sanitize:
        return _test_sanitized(arguments)
    _prepare(arguments)
    if arguments.watch_kernels:
        return _test_watched_kernels(arguments)
    return status([str(VENV_PYTHON), "-m", "pytest", *arguments.rest])


def _watched_environment() -> Dict[str, str]:
    """For a process that loads code which was compiled with the sanitizers."""
    # Python itself is not built with it; the C++ library must be there when it looks for what throws.
    libraries = [output(["c++", f"-print-file-name={name}"]) for name in ("libasan.so", "libstdc++.so")]
    return {
        "LD_PRELOAD": " ".join(str(library) for library in libraries),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python's own, at exit
        "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
    }


def _sanitized_environment() -> Dict[str, str]:
    """For a process that imports the core that `compile_sanitized` made."""
    return {**_watched_environment(), "LUCH_ISA": "v3"}


# What a sanitizer writes before it ends the process is seen.
WATCHED_PYTEST = [str(VENV_PYTHON), "-m", "pytest", "-p", "no:cacheprovider", "--capture=sys"]


# What runs watched: all of tests/native, and of the hard cases those that ask the core's parts one by one.
WATCHED = ["tests/native"] + [
    f"tests/hard_cases/test_{name}.py"
    for name in ("closures", "closure_samples", "light_samples", "medium_samples", "sampler", "structures")
]


def _test_sanitized(arguments: Arguments) -> int:
    """WATCHED with every memory access and every undefined operation watched."""
    ensure_environment()
    folder = compile_sanitized(arguments.jobs)
    watched = _sanitized_environment()
    command = [*WATCHED_PYTEST, "-o", f"pythonpath={folder} . tests"]
    # The CUDA kernels run there on fibers, whose stacks AddressSanitizer does not know, and from the source tree.
    command += ["-m", "not long", "--ignore", "tests/native/test_accel_cuda.py", *WATCHED]
    return status([*command, *arguments.rest], extra=watched)


def _test_watched_kernels(arguments: Arguments) -> int:
    """The kernels' sources as tests/native runs them by fibers, every access to an array of the device watched."""
    watched = {**_watched_environment(), "LUCH_WATCH_KERNELS": "1"}
    return status([*WATCHED_PYTEST, "-k", "fibers", "tests/native", *arguments.rest], extra=watched)


def fuzz(arguments: Arguments) -> int:
    """tests/fuzz, for as long as is asked for. 1 if something was found."""
    if arguments.sanitize:
        ensure_environment()
        core, watched = compile_sanitized(arguments.jobs), _sanitized_environment()
    else:
        _prepare(arguments)
        core, watched = NATIVE, {}
    folders = [str(folder) for folder in (core, ROOT, ROOT / "tests")]
    extra = {**watched, "PYTHONPATH": os.pathsep.join(folders)}
    options = ["--seconds", str(arguments.seconds), "--seed", str(arguments.seed), *arguments.rest]
    return status([str(VENV_PYTHON), "-m", "fuzz.runner", *options], extra=extra)


def bench(arguments: Arguments) -> int:
    folder = ROOT / "tests" / "bench"
    names = sorted(path.stem.replace("_", "-") for path in folder.glob("*.py") if not path.stem.startswith("_"))
    if arguments.name is None:
        print("benches:", ", ".join(names))
        return 0
    if arguments.name.replace("_", "-") not in names:
        raise BuildFailure(f"no bench named {arguments.name}; there are: {', '.join(names)}")
    _prepare(arguments)
    return status([str(VENV_PYTHON), str(folder / f"{arguments.name.replace('-', '_')}.py"), *arguments.rest])


def check(arguments: Arguments) -> int:
    from buildtools.gate import run_gate

    ensure_environment()
    return run_gate()


def package(arguments: Arguments) -> int:
    from buildtools.package import build_extension

    _prepare(arguments)  # the wheel is made from the same compilation
    pairs = [text.partition("=") for text in arguments.headers]
    headers = {tag: Path(folder).resolve() for tag, _, folder in pairs}
    print(build_extension(arguments.isa, arguments.jobs, headers))
    return 0


def clean(arguments: Arguments) -> int:
    folders = [*ROOT.glob(".build*"), OUT, DIST, AHEAD, *([VENV] if arguments.all else [])]
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

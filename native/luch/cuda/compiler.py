"""Kernels from source: NVRTC behind a disk cache of our own.

CuPy's cache does not see the headers that a kernel includes, and its compiler always flushes denormals; so the
kernels are compiled here. The key of a compiled kernel covers every header and kernel file, the flags, the
compiler's version and the architecture: an edited header can never run stale. What `build.py build --cuda` compiled
ahead of time lies in luch/kernels and is taken first; its key leaves out the compiler's version.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from luch.cuda.device import DeviceError, Module, architecture_of, cupy

PACKAGE = Path(__file__).resolve().parents[1]
AHEAD = PACKAGE / "kernels"  # NAME.cubin, compiled by build.py


def source_folders() -> tuple[Path, Path]:
    """The folders of the shared headers and of the kernels: inside the installed package, or of the source tree."""
    for base in (PACKAGE, PACKAGE.parent):
        include, kernels = base / "include", base / ("cuda_source" if base == PACKAGE else "cuda")
        if (include / "luch" / "platform.h").is_file() and (kernels / "kernels.json").is_file():
            return include, kernels
    raise DeviceError(f"The kernels' sources are missing beside {PACKAGE}; install Luch again.")


@functools.cache
def table() -> dict[str, Any]:
    """kernels.json: architectures, flags of each precision, modules."""
    result: dict[str, Any] = json.loads((source_folders()[1] / "kernels.json").read_text(encoding="utf-8"))
    return result


@functools.cache
def _sources_hash() -> str:
    digest = hashlib.sha256()
    for folder in source_folders():
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".h", ".inc", ".cuh", ".cu"):
                digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def source_of(module: str) -> Path:
    """The .cu file of a module, tracer or builder of kernels.json."""
    name: str = (table()["modules"] | table()["tracers"] | table()["builders"])[module]
    return source_folders()[1] / name


def flags(precision: str) -> list[str]:
    """What decides the numbers: of the table, the same for NVRTC and nvcc."""
    return [*table()["flags"]["all"], *table()["flags"][precision]]


def ahead_name(module: str, precision: str, architecture: int) -> str:
    """File name under which a kernel compiled ahead of time is looked for."""
    parts = [_sources_hash(), source_of(module).name, *flags(precision), str(architecture)]
    return (
        f"{module}-{precision}-sm_{architecture}-{hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:16]}.cubin"
    )


@functools.cache
def load(module: str, precision: str) -> Module:
    """The module of kernels.json for the current device. Raises DeviceError if it does not compile."""
    architecture = architecture_of(cupy())
    ready = AHEAD / ahead_name(module, precision, architecture)
    if ready.is_file():
        return Module(ready.read_bytes())
    return Module(compiled(module, precision, architecture))


def compiled(module: str, precision: str, architecture: int) -> bytes:
    """Machine code (PTX where NVRTC is older than the device) out of the cache, or compiled now and kept there."""
    from cupy.cuda import nvrtc  # needs no device

    version = ".".join(str(part) for part in nvrtc.getVersion())
    name = f"{Path(ahead_name(module, precision, architecture)).stem}-nvrtc-{version}.bin"
    folder = cache_folder()
    if folder is not None and (folder / name).is_file():
        return (folder / name).read_bytes()
    image = _compile(nvrtc, module, precision, architecture)
    if folder is not None:
        _keep(folder, name, image)
    return image


def _compile(nvrtc: Any, module: str, precision: str, architecture: int) -> bytes:
    include, kernels = source_folders()
    known = [a for a in nvrtc.getSupportedArchs() if a <= architecture]
    target = f"sm_{architecture}" if architecture in known else f"compute_{max(known)}"  # the driver compiles PTX on
    options = [f"-arch={target}", f"-I{include}", f"-I{kernels}", *flags(precision)]
    source = source_of(module)
    program = nvrtc.createProgram(source.read_text(encoding="utf-8"), str(source), (), ())
    try:
        nvrtc.compileProgram(program, tuple(options))
        image: bytes = nvrtc.getCUBIN(program) if target.startswith("sm_") else nvrtc.getPTX(program)
    except nvrtc.NVRTCError as error:
        log = nvrtc.getProgramLog(program)
        raise DeviceError(f"The kernels of {module} do not compile for {target}: {error}\n{log[:4000]}") from error
    finally:
        nvrtc.destroyProgram(program)
    return image


@functools.cache
def cache_folder() -> Path | None:
    """Where compiled kernels are kept: $XDG_CACHE_HOME/luch or ~/.cache/luch. None, and said so, if not writable."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = Path(base) / "luch" / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        print(f"luch: {folder} is not writable ({error}); kernels are compiled anew each time. "
              "Set XDG_CACHE_HOME to a folder that is.", file=sys.stderr)  # fmt: skip
        return None


def _keep(folder: Path, name: str, image: bytes) -> None:
    """Whole or not at all: another process may read it at any time."""
    try:
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(image)
        os.replace(file.name, folder / name)
    except OSError as error:
        print(f"luch: {folder / name} was not written: {error}", file=sys.stderr)

"""Kernels from source: NVRTC behind a disk cache of our own.

CuPy's cache does not see the headers that a kernel includes, and its compiler always flushes denormals; so the
kernels are compiled here. The key of a compiled kernel covers every header and kernel file, the flags, the
compiler's version and the architecture: an edited header can never run stale. What `build.py build --cuda` compiled
ahead of time lies in luch/kernels and is taken first; its key leaves out the compiler's version.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from luch.cuda.device import DeviceError, Module, architecture_of, cupy

PACKAGE = Path(__file__).resolve().parents[1]
# Scenes whose kernels stay on the device: some megabytes each.
SCENES_KEPT = 8
AHEAD = PACKAGE / "kernels"  # NAME.cubin, compiled by build.py
_LOADED: dict[tuple[str, str, tuple[str, ...], int], Module] = {}  # as load() was asked, and the device
ASK_SECONDS = 0.05  # between two questions of who waits for a compiler
# NVRTC optimises the functions of a program on threads: half the time on two cores. Version 13.0 is the oldest tried.
SPLITS_FROM, MOST_SPLIT = (13, 0), 8
SCENE_PROGRAMS = "luch_scene_programs.cuh"  # the header that a scene's own kernels include


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
    """The .cu file of a module, tracer, builder or stage of kernels.json."""
    known = table()["modules"] | table()["tracers"] | table()["builders"] | table()["stages"]
    name: str = known[module]
    return source_folders()[1] / name


def ready_made(module: str) -> list[tuple[str, ...]]:
    """What `build.py build --cuda` compiles a module with beside the precision's flags: once for each of these."""
    return [tuple(defines) for defines in table()["ahead"].get(module, [[]])]


def flags(precision: str) -> list[str]:
    """What decides the numbers: of the table, the same for NVRTC and nvcc."""
    return [*table()["flags"]["all"], *table()["flags"][precision]]


def ahead_name(module: str, precision: str, architecture: int, defines: Sequence[str] = ()) -> str:
    """File name under which a kernel compiled ahead of time is looked for. architecture 0: PTX, for all of them;
    defines: what it was compiled with beside, as "-DNAME=1", in any order.
    """
    parts = [_sources_hash(), source_of(module).name, *flags(precision), *sorted(defines), str(architecture)]
    key = hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:16]
    return (
        f"{module}-{precision}-{key}.ptx"
        if architecture == 0
        else f"{module}-{precision}-sm_{architecture}-{key}.cubin"
    )


class NotWanted(Exception):
    """Who waits for kernels wants them no more. The compiler goes on for who comes next: NVRTC's own way to stop it
    breaks off in ptxas.
    """


def load(
    module: str, precision: str, defines: tuple[str, ...] = (), goes_on: Callable[[], bool] | None = None
) -> Module:
    """The module of kernels.json for the current device. Raises DeviceError if it does not compile.

    defines: what it is compiled with beside, as "-DNAME=1"; goes_on: asked while it compiles; NotWanted where it says
    no.
    """
    asked = (module, precision, defines, int(cupy().cuda.Device().id))
    if asked not in _LOADED:
        architecture = architecture_of(cupy())
        image = ahead(module, precision, architecture, defines) or kept(module, precision, architecture, "", defines)
        if image is None:
            image = compiling(module, precision, architecture, "", defines).wait(goes_on)
        _LOADED[asked] = Module(image)
    return _LOADED[asked]


def forget() -> None:
    """What was loaded so far."""
    _LOADED.clear()
    scene_module.cache_clear()


def _runs_on(architecture: int) -> list[int]:
    """Of the architectures of kernels.json those whose machine code runs there, the best first: code for 8.0 does on
    8.6 and 8.9, as all of one major version is upwards compatible.
    """
    known: list[int] = table()["architectures"]
    return sorted((a for a in known if a // 10 == architecture // 10 and a <= architecture), reverse=True)


def ahead_file(module: str, precision: str, architecture: int, defines: Sequence[str] = ()) -> Path | None:
    """Where what build.py compiled ahead of time lies: machine code, or PTX where it did not know the architecture.

    The stages have no PTX: the driver would need minutes for all that general code may do, NVRTC needs seconds for
    what a scene does.
    """
    for target in (*_runs_on(architecture), 0):
        ready = AHEAD / ahead_name(module, precision, target, defines)
        if ready.is_file():
            return ready
    return None


def ahead(module: str, precision: str, architecture: int, defines: Sequence[str] = ()) -> bytes | None:
    """What lies there."""
    file = ahead_file(module, precision, architecture, defines)
    return None if file is None else file.read_bytes()


@functools.lru_cache(maxsize=SCENES_KEPT)
def scene_module(image: bytes, device: int) -> Module:
    """A scene's kernels on a device, loaded once however often the scene is rendered."""
    return Module(image)


def kept(module: str, precision: str, architecture: int, programs: str, defines: Sequence[str]) -> bytes | None:
    """What compiled() would give, if it was compiled before."""
    from cupy.cuda import nvrtc  # needs no device

    return _kept(_cache_name(nvrtc, _Unit(module, precision, architecture, programs, tuple(defines))))


def compiled(module: str, precision: str, architecture: int, programs: str, defines: Sequence[str]) -> bytes:
    """Machine code (PTX where NVRTC is older than the device) out of the cache, or compiled now and kept there.

    programs: a scene's, luch.cuda.programs.source; "": none. Who renders asks for compiling(), so that nothing is
    compiled twice at once.
    """
    from cupy.cuda import nvrtc

    unit = _Unit(module, precision, architecture, programs, tuple(defines))
    return _kept(_cache_name(nvrtc, unit)) or _compile_and_keep(nvrtc, unit)


class Compilation(threading.Thread):
    """Kernels on their way: a scene's own while general ones render it, or such as somebody waits for."""

    def __init__(self, asked: tuple[str, str, int, str, tuple[str, ...]]) -> None:
        """asked: of compiled()."""
        # A process that ends waits for it: NVRTC would go on while its library is taken down, and one in sixteen such
        # processes broke off. What was compiled serves the next one.
        super().__init__(name="Luch compiles kernels", daemon=False)
        self._asked = asked
        self.image: bytes | None = None
        self.failure: Exception | None = None
        self.seconds = 0.0

    def run(self) -> None:
        began = time.perf_counter()
        try:
            self.image = compiled(*self._asked)
        except Exception as error:  # handed to the threads that render, which raise it
            self.failure = error
        self.seconds = time.perf_counter() - began
        with _STARTING:
            del _UNDER_WAY[self._asked]

    def wait(self, goes_on: Callable[[], bool] | None = None) -> bytes:
        """What it compiles. Raises what it failed by, and NotWanted where goes_on, asked meanwhile, says no."""
        while self.is_alive():
            if goes_on is not None and not goes_on():
                raise NotWanted
            self.join(ASK_SECONDS)
        if self.image is None:
            raise self.failure or RuntimeError(f"{self.name}: nothing was compiled")
        return self.image


_UNDER_WAY: dict[tuple[str, str, int, str, tuple[str, ...]], Compilation] = {}
_STARTING = threading.Lock()


def compiling(module: str, precision: str, architecture: int, programs: str, defines: Sequence[str]) -> Compilation:
    """compiled() on a thread, one however many renders ask for the same: an animation draws hundreds of frames
    while its kernels compile.
    """
    asked = (module, precision, architecture, programs, tuple(defines))
    with _STARTING:
        if asked not in _UNDER_WAY:
            _UNDER_WAY[asked] = Compilation(asked)
            _UNDER_WAY[asked].start()
        return _UNDER_WAY[asked]


def quiet(seconds: float = float("inf")) -> bool:
    """Waits until nothing is compiled any more, so long at most; whether that is so."""
    ends = time.monotonic() + seconds
    while under_way := list(_UNDER_WAY.values()):
        if time.monotonic() >= ends:
            return False
        under_way[0].join(min(threading.TIMEOUT_MAX, ends - time.monotonic()))
    return True


class _Unit(NamedTuple):
    module: str
    precision: str
    architecture: int
    programs: str  # text of luch_scene_programs.cuh; "": none
    defines: tuple[str, ...]


def _cache_name(nvrtc: Any, unit: _Unit) -> str:
    version = ".".join(str(part) for part in nvrtc.getVersion())
    stem = Path(ahead_name(unit.module, unit.precision, unit.architecture)).stem
    if unit.programs or unit.defines:
        text = chr(0).join((unit.programs, *unit.defines))
        stem += "-scene-" + hashlib.sha256(text.encode()).hexdigest()[:16]
    return f"{stem}-nvrtc-{version}.bin"


def _kept(name: str) -> bytes | None:
    folder = cache_folder()
    return (folder / name).read_bytes() if folder is not None and (folder / name).is_file() else None


def _compile_and_keep(nvrtc: Any, unit: _Unit) -> bytes:
    try:
        image = _compile(nvrtc, unit)
    finally:
        _give_back()
    folder = cache_folder()
    if folder is not None:
        _keep(folder, _cache_name(nvrtc, unit), image)
    return image


def _give_back() -> None:
    """What NVRTC took and freed, half a gigabyte for a scene's stages: glibc's heap would keep it."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)) is not None:
        trim(0)


def _compile(nvrtc: Any, unit: _Unit) -> bytes:
    module, architecture = unit.module, unit.architecture
    include, kernels = source_folders()
    known = [a for a in nvrtc.getSupportedArchs() if a <= architecture]
    target = f"sm_{architecture}" if architecture in known else f"compute_{max(known)}"  # the driver compiles PTX on
    options = [f"-arch={target}", f"-I{include}", f"-I{kernels}", *flags(unit.precision), *unit.defines]
    if nvrtc.getVersion() >= SPLITS_FROM:
        options.append(f"-split-compile={min(MOST_SPLIT, os.cpu_count() or 1)}")  # on threads; the same instructions
    source = source_of(module)
    # CuPy wants bytes here, and only here.
    headers = ((unit.programs.encode(),), (SCENE_PROGRAMS.encode(),)) if unit.programs else ((), ())
    program = nvrtc.createProgram(source.read_text(encoding="utf-8"), str(source), *headers)
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

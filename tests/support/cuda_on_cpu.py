"""Stands in for CuPy and a GPU: arrays are NumPy's, kernels are compiled by the C++ compiler and run as fibers.

What it proves is the logic of kernels and of the Python around them, bit for bit; what it cannot: speed, races that
need two blocks at once, and that NVRTC gives the same arithmetic.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import subprocess
import sys
import threading
import types
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from luch.cuda import compiler, device

HERE = Path(__file__).parent
FIBERS, GPU = "fibers", "cuda"  # where a test's kernels run
# A kernel whose parameters stand in its source: paths.cu, shadow.cuh.
PLAIN_KERNEL = (
    r'extern "C" __global__ void\s+(?:__launch_bounds__\([^)]*\)\s*)?(\w+)\(([^)]*(?:RenderTask|Photon)[^)]*)\)\s*{'
)
FLAGS = ["-std=gnu++20", "-O1", "-march=x86-64-v3", "-ffp-contract=off", "-shared", "-fPIC", "-w"]
if os.environ.get("LUCH_WATCH_KERNELS"):  # build.py test --watch-kernels
    # Not their stacks: those are fibers', which AddressSanitizer cannot tell apart.
    FLAGS += ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "--param", "asan-stack=0", "-g1"]


class _Memory:
    def __init__(self, ptr: int) -> None:
        self.ptr = ptr


class Array(np.ndarray):  # type: ignore[type-arg]
    """A NumPy array that answers as CuPy's do."""

    @property
    def data(self) -> Any:
        return _Memory(self.__array_interface__["data"][0])

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return dict(self.__array_interface__)

    def get(self) -> Any:
        return np.array(self)

    def set(self, given: Any) -> None:
        self[...] = given


def _array(given: Any, dtype: Any = None) -> Any:
    return np.array(given, dtype=dtype).view(Array)


class _Pinned(bytearray):
    @property
    def ptr(self) -> int:
        return ctypes.addressof(ctypes.c_char.from_buffer(self))


class _Event:
    def record(self) -> None:
        pass

    def synchronize(self) -> None:
        pass


def compile_module(
    source: Path,
    precision: str,
    folder: Path,
    include: list[Path],
    shares_memory: bool = True,
    defines: Sequence[str] = (),
) -> str:
    """The kernels of one .cu file as a library, its path: run_NAME(parameters, grid, block) for each.

    shares_memory: False gives every thread an array of its own where the source says __shared__.
    """
    text = _planned(_reached(source, include[1]), defines)
    names = sorted(set(re.findall(r"LUCH_\w*KERNEL\((\w+)\)\(LUCH_ARGUMENTS\)", text)))
    builds = re.findall(r"LUCH_BUILD_KERNEL\((\w+)\)\(const luch::BuildTask", text)
    traces = re.findall(r"LUCH_\w*TRACE_KERNEL\((\w+)\)\(LUCH_TRACE_ARGUMENTS\)", text)
    stages = [(name, ["luch::RenderTask"]) for name in re.findall(r"LUCH_STAGE\((\w+)\) {", text)]
    stages += [(name, _types(given)) for name, given in re.findall(PLAIN_KERNEL, text)]
    assert names or builds or traces or stages
    runs = (
        "".join(
            f'extern "C" void run_{name}(void** p, unsigned grid, unsigned block) {{\n'
            f"    cuda_on_cpu::launch(grid, block, [p] {{ ::{name}(*(LUCH_VIEW*)p[0], *(luch::Primitives*)p[1], "
            "*(luch::RayBatch*)p[2]); });\n}\n"
            for name in names
        )
        + "".join(
            f'extern "C" void run_{name}(void** p, unsigned grid, unsigned block) {{\n'
            f"    cuda_on_cpu::launch(grid, block, [p] {{ ::{name}(*(luch::BuildTask*)p[0]); }});\n}}\n"
            for name in builds
        )
        + "".join(
            f'extern "C" void run_{name}(void** p, unsigned grid, unsigned block) {{\n'
            f"    cuda_on_cpu::launch(grid, block, [p] {{ ::{name}(*(luch::TwoLevelView<LUCH_VIEW>*)p[0], "
            "*(luch::TraceTask*)p[1]); });\n}\n"
            for name in traces
        )
        + "".join(
            f'extern "C" void run_{name}(void** p, unsigned grid, unsigned block) {{\n'
            f"    cuda_on_cpu::launch(grid, block, [p] {{ ::{name}("
            f"{', '.join(f'*({kind}*)p[{k}]' for k, kind in enumerate(kinds))}); }});\n}}\n"
            for name, kinds in stages
        )
    )
    file = folder / f"{source.stem}_{precision}.cpp"
    file.write_text(f'#include "{HERE / "cuda_on_cpu.h"}"\n#include "{source}"\n{runs}')
    library = file.with_suffix(".so")
    options = [f"-DLUCH_PRECISION={precision}", *(f"-I{path}" for path in include), *defines]
    options += [] if shares_memory else ["-D__shared__="]
    subprocess.run(["c++", *FLAGS, *options, str(file), "-o", str(library)], check=True)
    return str(library)


def compiles(text: str, include: list[Path], defines: Sequence[str]) -> bool:
    """Whether device code is understood; nothing of it runs."""
    options = ["-DLUCH_PRECISION=WATERTIGHT", *(f"-I{path}" for path in include), *defines]
    command = ["c++", *FLAGS, "-fsyntax-only", "-x", "c++", *options, "-"]
    whole = f'#include "{HERE / "cuda_on_cpu.h"}"\n{text}'
    return subprocess.run(command, input=whole, text=True).returncode == 0


def library(text: str, folder: Path, include: list[Path], defines: Sequence[str]) -> ctypes.CDLL:
    """Device code, as it is compiled for a GPU but with `defines`: its functions that are extern "C"."""
    source, built = folder / "library.cpp", folder / "library.so"
    source.write_text(f'#include "{HERE / "cuda_on_cpu.h"}"\n{text}')
    options = ["-DLUCH_PRECISION=WATERTIGHT", *(f"-I{path}" for path in include), *defines]
    subprocess.run(["c++", *FLAGS, *options, str(source), "-o", str(built)], check=True)
    return ctypes.CDLL(str(built))


def _types(parameters: str) -> list[str]:
    """Of a kernel's parameters, as they stand in its source."""
    words = [
        parameter.replace("__grid_constant__", "").replace("const ", "").split() for parameter in parameters.split(",")
    ]
    return [{"u32": "luch::u32"}.get(word[0], word[0]) for word in words]


def _planned(text: str, defines: Sequence[str]) -> str:
    """Without the kernels of effects that the plan leaves out."""
    for absent in re.findall(r"-D(LUCH_PLAN_\w+)=0", " ".join(defines)):
        text = re.sub(rf"^#if {absent}$.*?^#endif$", "", text, flags=re.MULTILINE | re.DOTALL)
    return text


def _reached(source: Path, kernels: Path) -> str:
    """The source with the kernel files that it includes."""
    text = source.read_text(encoding="utf-8")
    included = re.findall(r'#include "(\w+/\w+\.cuh?)"', text)
    return text + "".join(_reached(kernels / name, kernels) for name in included)


class _Device:
    """One of the devices that are pretended; each thread has its current one."""

    current = threading.local()
    compute_capability = "90"
    attributes: ClassVar = {"MaxThreadsPerMultiProcessor": 2048, "MultiProcessorCount": 2}

    def __init__(self, index: int | None = None) -> None:
        self.id = getattr(self.current, "id", 0) if index is None else index
        self._before: list[int] = []

    def __enter__(self) -> _Device:
        self._before.append(getattr(self.current, "id", 0))
        self.current.id = self.id
        return self

    def __exit__(self, *_: object) -> None:
        self.current.id = self._before.pop()

    def synchronize(self) -> None:
        pass


def fake_cupy(devices: int = 1) -> Any:
    """A module with what luch.cuda asks of CuPy."""
    libraries: dict[int, ctypes.CDLL] = {}
    functions: dict[int, Any] = {}
    running = threading.Lock()

    def module_load_data(image: bytes) -> int:
        libraries[len(libraries) + 1] = ctypes.CDLL(image.decode())
        return len(libraries)

    def module_get_function(module: int, name: str) -> int:
        function = getattr(libraries[module], f"run_{name}")
        functions[len(functions) + 1] = function
        return len(functions)

    def launch_kernel(function: int, grid: int, gy: int, gz: int, block: int, by: int, bz: int, shared: int,
                      stream: int, parameters: int, extra: int) -> None:  # fmt: skip
        assert (gy, gz, by, bz, shared, stream, extra) == (1, 1, 1, 1, 0, 0, 0)
        with running:  # fibers of one kernel at a time
            functions[function](ctypes.c_void_p(parameters), grid, block)

    driver = types.SimpleNamespace(
        moduleLoadData=module_load_data, moduleUnload=lambda module: None, moduleGetFunction=module_get_function, launchKernel=launch_kernel,
        funcGetAttribute=lambda attribute, function: 32,
        occupancyMaxActiveBlocksPerMultiprocessor=lambda function, block, shared: 2,
    )  # fmt: skip
    properties = {"name": b"fibers", "multiProcessorCount": 2, "l2CacheSize": 0, "totalGlobalMem": 0}
    runtime = types.SimpleNamespace(
        free=lambda ptr: None, getDeviceCount=lambda: devices, getDeviceProperties=lambda i: properties, driverGetVersion=lambda: 0,
        runtimeGetVersion=lambda: 0, memGetInfo=lambda: (1 << 26, 1 << 26),
    )  # fmt: skip
    cuda = types.SimpleNamespace(
        Device=_Device, driver=driver, runtime=runtime, get_current_stream=lambda: types.SimpleNamespace(ptr=0, synchronize=lambda: None),
        alloc_pinned_memory=_Pinned, memory=types.SimpleNamespace(OutOfMemoryError=MemoryError),
        Event=_Event, get_elapsed_time=lambda a, b: 1.0,
    )  # fmt: skip
    return types.SimpleNamespace(
        __version__="fibers", cuda=cuda, asarray=_array, ascontiguousarray=_array,
        asnumpy=np.array, full=lambda *a: np.full(*a).view(Array), empty=lambda *a: np.full(*a[:1], 77, *a[1:]).view(Array),
        get_default_memory_pool=lambda: types.SimpleNamespace(free_all_blocks=lambda: None),
        zeros=lambda *a: np.zeros(*a).view(Array), flatnonzero=lambda a: np.flatnonzero(a).view(Array), argsort=lambda a: np.argsort(a).view(Array),
        sort=lambda a: np.sort(a).view(Array), searchsorted=lambda a, b: np.searchsorted(a, b).view(Array), concatenate=lambda a: np.concatenate(a).view(Array),
    )  # fmt: skip


@contextmanager
def standing_in(folder: Path, shares_memory: bool = True) -> Iterator[None]:
    """Kernels that are loaded meanwhile run here; what is compiled lies in folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "cupy", fake_cupy())
        patch.setattr(compiler, "AHEAD", folder)

        def compiled(module: str, precision: str, architecture: int, programs: str, defines: Sequence[str]) -> bytes:
            if not programs and not defines:
                source, folders = compiler.source_of(module), list(compiler.source_folders())
                return compile_module(source, precision, folder, folders, shares_memory).encode()
            own = folder / hashlib.sha256((programs + " ".join(defines)).encode()).hexdigest()[:8]
            library = own / f"{compiler.source_of(module).stem}_{precision}.so"
            if library.exists():
                return str(library).encode()
            own.mkdir(exist_ok=True)
            (own / compiler.SCENE_PROGRAMS).write_text(programs)
            source, folders = compiler.source_of(module), [*compiler.source_folders(), own]
            return compile_module(
                source, precision, own, folders, shares_memory, [*defines, "-DCUDA_ON_CPU_STACK=(1<<18)"]
            ).encode()

        patch.setattr(compiler, "compiled", compiled)
        patch.setattr(compiler, "kept", lambda *given: None)
        forget()
        yield
    forget()


def forget() -> None:
    """What was loaded for the device so far."""
    for cached in (device.cupy, device.available):
        cached.cache_clear()
    compiler.forget()

"""The GPU and CuPy, asked for late: what is missing is told in one message with its remedy."""

from __future__ import annotations

import ctypes
import functools
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

OLDEST = 75  # compute capability 7.5: Turing


class DeviceError(RuntimeError):
    """CUDA cannot be used here; the message says why and what to do."""


@functools.cache
def cupy() -> Any:
    """The CuPy module, with a device behind it that can run the kernels. Raises DeviceError."""
    try:
        import cupy as module
    except Exception as error:  # a broken CuPy raises what it likes
        raise DeviceError(
            f"CUDA needs CuPy, which cannot be imported ({error}). Install it with `pip install cupy-cuda13x` "
            "(cupy-cuda12x for a driver older than 580)."
        ) from error
    try:
        count = module.cuda.runtime.getDeviceCount()
    except module.cuda.runtime.CUDARuntimeError as error:
        raise DeviceError(f"No CUDA driver that CuPy can use ({error}). Install or update NVIDIA's driver.") from error
    if count == 0:
        raise DeviceError("No CUDA device is visible. Check `nvidia-smi` and CUDA_VISIBLE_DEVICES.")
    if architecture_of(module) < OLDEST:
        raise DeviceError(
            f"This GPU has compute capability {module.cuda.Device().compute_capability}; Luch needs {OLDEST} (Turing, "
            "2018) or newer. Choose another with CUDA_VISIBLE_DEVICES, or device CPU."
        )
    return module


def architecture_of(module: Any) -> int:
    """Compute capability of CuPy's current device, as 75 for 7.5."""
    return int(module.cuda.Device().compute_capability)


# What a GPU said when it failed while it rendered: its context is lost then, for as long as this process lives.
_lost: list[str] = []


@contextmanager
def faults_told() -> Iterator[None]:
    """An error of CuPy's or the driver's that comes out of rendering becomes a DeviceError that says what to do.

    After it no GPU is used in this process (`require_sound`): a kernel that trapped takes the context of all with it.
    """
    try:
        yield
    except DeviceError:
        raise
    except Exception as error:
        if not type(error).__module__.startswith("cupy"):
            raise
        if isinstance(error, MemoryError):  # names its bytes, and harms nobody else
            raise DeviceError(f"The GPU's memory does not suffice ({error}). Lower the resolution.") from error
        _lost.append(f"{type(error).__name__}: {error}")
        raise DeviceError(
            f"The GPU failed while it rendered ({_lost[-1]}). Until Blender is started again, renders go to the CPU."
        ) from error


def require_sound() -> None:
    """Raises DeviceError if a GPU has failed in this process."""
    if _lost:
        raise DeviceError(f"The GPU has failed in this process ({_lost[-1]}). Start Blender again to use it.")


@functools.cache
def available() -> bool:
    """Whether CUDA can be used here."""
    try:
        cupy()
    except DeviceError:
        return False
    return True


def enter_context() -> None:
    """Makes the device's context the current one of this thread: the driver's own calls ask for it."""
    cupy().cuda.runtime.free(0)


def is_device_array(array: object) -> bool:
    """Whether an array lies on a GPU (CuPy's, PyTorch's, ...)."""
    return hasattr(array, "__cuda_array_interface__")


def describe() -> dict[str, Any]:
    """What a record of a measurement must name: device, its size, driver and CuPy."""
    module = cupy()
    properties = module.cuda.runtime.getDeviceProperties(module.cuda.Device().id)
    return {
        "device": properties["name"].decode(),
        "multiprocessors": properties["multiProcessorCount"],
        "compute_capability": architecture_of(module) / 10,
        "l2_bytes": properties.get("l2CacheSize"),
        "memory_bytes": properties["totalGlobalMem"],
        "cuda_driver": module.cuda.runtime.driverGetVersion(),
        "cuda_runtime": module.cuda.runtime.runtimeGetVersion(),
        "cupy": module.__version__,
    }


def kernel_seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Median time of what work() puts on the current stream, by CUDA events, after one run that warms up."""
    module = cupy()
    work()
    times: list[float] = []
    for _ in range(repeats):
        start, end = module.cuda.Event(), module.cuda.Event()
        start.record()
        work()
        end.record()
        end.synchronize()
        times.append(float(module.cuda.get_elapsed_time(start, end)) / 1000)
    return sorted(times)[repeats // 2]


class Kernel:
    """One __global__ function of a loaded module, launched with arguments given as bytes."""

    def __init__(self, name: str, function: int) -> None:
        self.name, self._function = name, function
        self._resident: dict[int, int] = {}

    def launch(self, grid: int, block: int, arguments: list[bytes], shared_bytes: int = 0) -> None:
        """Puts it on CuPy's current stream. Each argument is the memory of one parameter, as C++ lays it out."""
        if grid == 0:
            return
        stream = cupy().cuda.get_current_stream().ptr
        values = [ctypes.create_string_buffer(argument, len(argument)) for argument in arguments]
        pointers = (ctypes.c_void_p * len(values))(*[ctypes.addressof(value) for value in values])
        driver = cupy().cuda.driver
        driver.launchKernel(
            self._function, grid, 1, 1, block, 1, 1, shared_bytes, stream, ctypes.addressof(pointers), 0
        )

    def resident_blocks(self, block: int) -> int:
        """How many blocks of that many threads run at once on the whole device."""
        if block not in self._resident:
            fit = cupy().cuda.driver.occupancyMaxActiveBlocksPerMultiprocessor(self._function, block, 0)
            self._resident[block] = fit * cupy().cuda.Device().attributes["MultiProcessorCount"]
        return self._resident[block]

    def properties(self, block: int, shared_bytes: int = 0) -> dict[str, float]:
        """Registers a thread, local and shared bytes, and the part of a multiprocessor's threads that fit (occupancy)."""
        driver, device = cupy().cuda.driver, cupy().cuda.Device()
        blocks = driver.occupancyMaxActiveBlocksPerMultiprocessor(self._function, block, shared_bytes)
        # CUfunction_attribute: 1 shared, 3 local, 4 registers
        return {
            "registers": driver.funcGetAttribute(4, self._function),
            "local_bytes": driver.funcGetAttribute(3, self._function),
            "shared_bytes": driver.funcGetAttribute(1, self._function) + shared_bytes,
            "blocks": blocks,
            "occupancy": blocks * block / device.attributes["MaxThreadsPerMultiProcessor"],
        }


class Module:
    """A loaded cubin or PTX; unloaded with its last user, but for the end of the process, when the driver goes first."""

    def __init__(self, image: bytes) -> None:
        enter_context()
        self._module = cupy().cuda.driver.moduleLoadData(image)
        weakref.finalize(self, cupy().cuda.driver.moduleUnload, self._module).atexit = False
        self._kernels: dict[str, Kernel] = {}

    def kernel(self, name: str) -> Kernel:
        """The extern "C" function of that name."""
        if name not in self._kernels:
            self._kernels[name] = Kernel(name, cupy().cuda.driver.moduleGetFunction(self._module, name))
        return self._kernels[name]

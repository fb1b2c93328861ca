"""Embree 4 out of the embreex wheel, by a C helper compiled on the spot. For races only."""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

HELPER = Path(__file__).with_name("embree_race.c")


@functools.cache
def load() -> ctypes.CDLL:
    """Loaded once, so that no build is charged for it. The helper with the library behind it. Raises SystemExit that names what is missing."""
    spec = importlib.util.find_spec("embreex")
    if spec is None or not spec.submodule_search_locations:
        raise SystemExit("embreex is not installed; run `python3 build.py setup`.")
    libraries = sorted(Path(spec.submodule_search_locations[0]).parent.glob("embreex.libs/libembree4*.so*"))
    if not libraries:
        raise SystemExit("The embreex wheel carries no libembree4; this race needs version 4.4 of it.")
    folder = Path(tempfile.mkdtemp(prefix="luch-embree-"))
    shared = folder / "embree_race.so"
    subprocess.run(["cc", "-O2", "-march=native", "-shared", "-fPIC", HELPER, "-o", shared, "-ldl"], check=True)
    helper = ctypes.CDLL(str(shared))
    for tbb in libraries[0].parent.glob("libtbb*.so*"):
        ctypes.CDLL(str(tbb), mode=ctypes.RTLD_GLOBAL)
    if not helper.embree_load(str(libraries[0]).encode()):
        raise SystemExit(f"{libraries[0]} could not be loaded.")
    helper.embree_device.restype = helper.embree_build.restype = ctypes.c_void_p
    helper.embree_bytes.restype = ctypes.c_longlong
    return helper


@functools.cache
def _device(threads: int) -> ctypes.c_void_p:
    return ctypes.c_void_p(load().embree_device(f"threads={threads}".encode()))


class EmbreeAccel:
    """Looks like luch.Accel. quality: "default", "robust" (watertight), "high" (spatial splits)."""

    def __init__(
        self, positions: npt.NDArray[np.float32], triangles: npt.NDArray[np.uint32], quality: str, threads: int
    ) -> None:
        self._helper = load()
        self._kept = (positions, triangles)  # shared with Embree
        before = int(self._helper.embree_bytes())
        self._scene = ctypes.c_void_p(self._helper.embree_build(
            _device(threads), _pointer(positions), ctypes.c_size_t(len(positions)), _pointer(triangles),
            ctypes.c_size_t(len(triangles)), int(quality == "robust"), int(quality == "high")))  # fmt: skip
        self.bytes = int(self._helper.embree_bytes()) - before

    def closest(self, rays: npt.NDArray[np.float32]) -> tuple[npt.NDArray[Any], ...]:
        """t, prim, u, v."""
        n = len(rays)
        out = (np.empty(n, np.float32), np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32))
        self._helper.embree_closest(self._scene, _pointer(rays), ctypes.c_size_t(n), *map(_pointer, out))
        return out

    def any(self, rays: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Whether each ray hits anything."""
        out = np.empty(len(rays), np.uint8)
        self._helper.embree_any(self._scene, _pointer(rays), ctypes.c_size_t(len(rays)), _pointer(out))
        return out != 0


def _pointer(array: npt.NDArray[Any]) -> ctypes.c_void_p:
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)

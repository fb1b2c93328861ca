"""Open Image Denoise: noise taken out of a finished picture, guided by what its surfaces look like.

The library is the one that Blender carries, or any other of the same interface: it is called through its C functions
(https://www.openimagedenoise.org/documentation.html), so that nothing has to be installed. What it gives is biased:
luch.report tells by how much.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import importlib.util
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from luch.scene import F32, Scene

if TYPE_CHECKING:
    from luch.render import Progress, Result

    Render = Callable[..., Result]
    Watch = Callable[[Progress], bool]

NAME = "libOpenImageDenoise.so.2"
REMEDY = "Blender carries it; without Blender, install the package `pyoidn` or name the library in LUCH_OIDN"
_FLOAT3, _CPU = 3, 1  # OIDN_FORMAT_FLOAT3, OIDN_DEVICE_TYPE_CPU
_LESS, _MORE = 64, 384  # pixels along an edge of the pictures that seconds are measured on
ALBEDO_PASS, NORMAL_PASS = "Denoising Albedo", "Denoising Normal"
NOISY_PASS = "Noisy Image"  # Cycles' name for the picture before the filter


class OidnError(RuntimeError):
    """The library's own words."""


def _places() -> Iterator[str]:
    """Where the library may be, the nearest first. Within Blender it is loaded already."""
    if "LUCH_OIDN" in os.environ:
        yield os.environ["LUCH_OIDN"]
    app: Any = getattr(sys.modules.get("bpy"), "app", None)
    if app is not None and app.binary_path:
        yield str(Path(app.binary_path).resolve().parent / "lib" / NAME)
    for package in ("bpy", "pyoidn", "oidn"):
        spec = importlib.util.find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec is not None else []:
            yield from (str(path) for path in sorted(Path(folder).rglob("libOpenImageDenoise.so*")))
    yield NAME
    found = ctypes.util.find_library("OpenImageDenoise")
    if found:
        yield found


@functools.cache
def library() -> ctypes.CDLL:
    """The library, loaded. Raises ImportError with the remedy where it cannot be had."""
    for place in _places():
        try:
            found = ctypes.CDLL(place)
        except OSError:
            continue
        return _declared(found)
    raise ImportError(f"Open Image Denoise ({NAME}) is not here; {REMEDY}")


def _declared(found: ctypes.CDLL) -> ctypes.CDLL:
    pointer, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
    for name, result, arguments in (
        ("oidnNewDevice", pointer, [ctypes.c_int]),
        ("oidnCommitDevice", None, [pointer]),
        ("oidnReleaseDevice", None, [pointer]),
        ("oidnGetDeviceError", ctypes.c_int, [pointer, ctypes.POINTER(text)]),
        ("oidnNewFilter", pointer, [pointer, text]),
        ("oidnSetSharedFilterImage", None, [pointer, text, pointer, ctypes.c_int, *[size] * 5]),
        ("oidnSetFilterBool", None, [pointer, text, ctypes.c_bool]),
        ("oidnCommitFilter", None, [pointer]),
        ("oidnExecuteFilter", None, [pointer]),
        ("oidnReleaseFilter", None, [pointer]),
    ):
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def available() -> bool:
    try:
        library()
    except ImportError:
        return False
    return True


def denoise(combined: F32, albedo: F32 | None = None, normal: F32 | None = None) -> F32:
    """Combined (H, W, 3 or 4) with less noise; alpha stays. albedo, normal (H, W, 3): of what the camera sees, both or
    none. Raises ImportError where there is no library, OidnError where it fails."""
    oidn = library()
    color = np.ascontiguousarray(combined[..., :3], dtype=np.float32)
    images = {"color": color, "output": np.zeros_like(color)}
    if albedo is not None and normal is not None:
        images["albedo"] = np.ascontiguousarray(albedo[..., :3], dtype=np.float32)
        images["normal"] = np.ascontiguousarray(normal[..., :3], dtype=np.float32)
    height, width = color.shape[:2]
    device = oidn.oidnNewDevice(_CPU)
    try:
        oidn.oidnCommitDevice(device)
        _check(oidn, device)
        run = oidn.oidnNewFilter(device, b"RT")
        for name, image in images.items():
            oidn.oidnSetSharedFilterImage(run, name.encode(), image.ctypes.data, _FLOAT3, width, height, 0, 0, 0)
        oidn.oidnSetFilterBool(run, b"hdr", True)
        oidn.oidnCommitFilter(run)
        oidn.oidnExecuteFilter(run)
        oidn.oidnReleaseFilter(run)
        _check(oidn, device)
    finally:
        oidn.oidnReleaseDevice(device)
    result = np.array(combined, dtype=np.float32)
    result[..., :3] = images["output"]
    return result


def beside(scene: Scene, render: Render, progress: Watch | None) -> Result:
    """As `rendered`, with the picture before the filter as a pass of its own, which the film asks for; where nothing is
    filtered it is Combined."""
    film = replace(scene.film, passes=[name for name in scene.film.passes if name != NOISY_PASS])
    kept: dict[str, F32] = {}

    def traced(noisy: Scene, *, progress: Watch | None = None) -> Result:
        result = render(noisy, progress=progress)
        kept[NOISY_PASS] = result.passes["Combined"]
        return result

    plain = replace(scene, film=film)
    result = rendered(plain, traced, progress) if scene.settings.denoise else traced(plain, progress=progress)
    result.passes |= kept
    return result


def rendered(scene: Scene, render: Render, progress: Watch | None) -> Result:
    """What `render` makes of the scene, denoised: Combined alone, every other pass as it is. The error that a render
    tells is that of its picture before; statistics hold "denoised". Without the library the picture stays as it is, and a
    warning says why. A time limit covers the filter, too."""
    settings, film = scene.settings, scene.film
    guides = [name for name in (ALBEDO_PASS, NORMAL_PASS) if name not in film.passes]
    traced = replace(scene, settings=replace(settings, denoise=False))
    try:
        library()
        if settings.time_limit > 0.0:
            traced.settings.time_limit = max(1e-3, settings.time_limit - seconds_for(film.pixels))
        traced = replace(traced, film=replace(film, passes=[*film.passes, *guides]))
        result = render(traced, progress=progress)
        began = time.perf_counter()
        if not result.cancelled:
            passes = result.passes
            passes["Combined"] = denoise(passes["Combined"], passes[ALBEDO_PASS], passes[NORMAL_PASS])
            took = time.perf_counter() - began
            result.stats.update(denoised=True, denoise_seconds=took, time_asked=settings.time_limit,
                                total_seconds=result.stats["total_seconds"] + took)  # fmt: skip
        for name in guides:
            result.passes.pop(name, None)
    except (ImportError, OidnError) as error:
        result = render(traced, progress=progress)
        result.stats["warnings"] = [*result.stats["warnings"], f"The picture is not denoised: {error}."]
    return result


def seconds_for(pixels: int) -> float:
    """What denoising a picture of so many pixels takes here: measured on two smaller ones."""
    took = []
    for edge in (_LESS, _MORE):
        picture = np.full((edge, edge, 3), 0.5, np.float32)
        began = time.perf_counter()
        denoise(picture, picture, picture)
        took.append(time.perf_counter() - began)
    a_pixel = max(0.0, took[1] - took[0]) / (_MORE**2 - _LESS**2)
    return took[0] + a_pixel * max(0, pixels - _LESS**2)


def _check(oidn: ctypes.CDLL, device: int) -> None:
    words = ctypes.c_char_p()
    if oidn.oidnGetDeviceError(device, ctypes.byref(words)) != 0:
        raise OidnError(f"Open Image Denoise: {(words.value or b'failed').decode(errors='replace')}")

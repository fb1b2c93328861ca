"""Memory: what a render needs at the least, held against what there is, before it is taken.

A kernel that lets processes ask for more than it has ends them when they use it: a picture that cannot fit has to be
refused by us, in words, while Blender and its unsaved work are still alive.
"""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from luch.scene import Film, Scene

GIB = float(1 << 30)
READ_PIXEL_BYTES = 4 * 4  # the floats of Combined, which are read from the film
# Of Combined alone: four sums in double, how many samples they are, and what is read from them.
LEAST_PIXEL_BYTES = 4 * 8 + 4 + READ_PIXEL_BYTES
_MEMINFO = Path("/proc/meminfo")
_STATM = Path("/proc/self/statm")
_CGROUP = Path("/sys/fs/cgroup")  # version 2, of a container; elsewhere these files are not there


class NotEnoughMemory(MemoryError):
    """A render that does not fit: how many bytes it needs, how many there are, and the remedy."""


def available_bytes() -> float:
    """What this process may still take: of the machine with its swap, of its container, of its address space."""
    limits = [_machine(), _container(), _address_space()]
    return min(limits)


def _machine() -> float:
    try:
        lines = dict(line.split(":", 1) for line in _MEMINFO.read_text().splitlines())
        return sum(float(lines[name].split()[0]) * 1024.0 for name in ("MemAvailable", "SwapFree"))
    except (OSError, KeyError, ValueError):  # not Linux: unknown
        return float("inf")


def _container() -> float:
    try:
        most = (_CGROUP / "memory.max").read_text().strip()
        used = float((_CGROUP / "memory.current").read_text())
        files = dict(line.split() for line in (_CGROUP / "memory.stat").read_text().splitlines())
        return float("inf") if most == "max" else float(most) - used + float(files.get("file", 0.0))
    except (OSError, ValueError):
        return float("inf")


def _address_space() -> float:
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return float("inf")
    try:
        return limit - float(_STATM.read_text().split()[0]) * resource.getpagesize()
    except OSError:
        return float("inf")


def scene_bytes(scene: Scene) -> float:
    """Of the arrays that the core copies."""
    return float(sum(array.nbytes for array in _arrays(scene)))


def _arrays(scene: Scene) -> Iterator[np.ndarray[Any, Any]]:
    for mesh in scene.meshes:
        optional = (mesh.normals, mesh.spheres, mesh.motion_positions, mesh.motion_normals)
        yield from (mesh.positions, mesh.triangles, mesh.material_slots)
        yield from (array for array in optional if array is not None)
        yield from (attribute.data for attribute in mesh.attributes.values())
        if mesh.curves is not None:
            yield mesh.curves.points
    for image in scene.images:
        yield image.pixels
    if scene.instances is not None:
        yield scene.instances.matrix


def film_bytes(film: Film, pixel_bytes: float = LEAST_PIXEL_BYTES) -> float:
    """Of the rendered region."""
    return float(film.pixels) * pixel_bytes


def require(scene: Scene, pixel_bytes: float = LEAST_PIXEL_BYTES, prepared: bool = False) -> None:
    """Raises NotEnoughMemory if film and copies alone are more than there is: structures come on top.

    prepared: all but the film is there already.
    """
    picture, geometry = film_bytes(scene.film, pixel_bytes), 0.0 if prepared else scene_bytes(scene)
    free = available_bytes()
    if picture + geometry > free:
        raise NotEnoughMemory(_told(scene, picture, geometry, "at least", free))


@contextmanager
def explained(scene: Scene) -> Iterator[None]:
    """An allocation that fails inside tells what was wanted, as far as it is known: NotEnoughMemory."""
    try:
        yield
    except NotEnoughMemory:
        raise
    except MemoryError as error:
        picture, geometry = film_bytes(scene.film), scene_bytes(scene)
        raise NotEnoughMemory(_told(scene, picture, geometry, "more than", available_bytes())) from error


def _told(scene: Scene, picture: float, geometry: float, how: str, free: float) -> str:
    film = scene.film
    return (
        f"The render needs {how} {(picture + geometry) / GIB:.2f} GiB ({picture + geometry:.0f} bytes): the picture of"
        f" {film.width} x {film.height} pixels {picture / GIB:.2f}, geometry and images {geometry / GIB:.2f}, and"
        f" structures beside; {free / GIB:.2f} GiB are free. Lower the resolution, render a border, or simplify the scene."
    )

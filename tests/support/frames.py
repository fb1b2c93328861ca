"""What frame after frame of one scene takes of the process."""

from __future__ import annotations

import resource
from pathlib import Path

from luch.cuda import compiler
from luch.render import render
from luch.scene import Scene


def resident_mib() -> float:
    """Of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2.0**20


def frame_growth(scene: Scene, frames: int = 100) -> float:
    """MiB a frame, counted from the thirteenth on, and not while kernels are compiled beside the first ones: NVRTC takes
    up to a gigabyte for that, once, and gives it back.
    """
    for _ in range(10):
        render(scene)
    for _ in range(3):  # the scene's own kernels take over
        compiler.quiet()
        render(scene)
    began = resident_mib()
    for frame in range(frames):
        scene.frame = frame
        render(scene)
    return (resident_mib() - began) / frames

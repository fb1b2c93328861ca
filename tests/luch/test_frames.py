"""A scene drawn frame after frame, without Blender: docs/reliability.md, 8."""

from __future__ import annotations

import threading

import pytest
from support.frames import frame_growth
from support.hard_geometry import room_scene


@pytest.mark.promise(8)
@pytest.mark.parametrize(("device", "frames"), [("CPU", 100), pytest.param("CUDA", 100, marks=pytest.mark.cuda)])
def test_frame_after_frame_takes_no_more_memory_or_threads(device: str, frames: int) -> None:
    scene = room_scene(0.0, "object", 0.8, size=16, samples=1, device=device)
    threads = threading.active_count()
    assert frame_growth(scene, frames) <= 0.05
    assert threading.active_count() <= threads  # compilers that other tests left may end meanwhile

"""One scene on the CPU and on CUDA, and how far their pictures may differ."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch._native import core
from luch.cuda.render import DeviceRenderer
from luch.render import render
from luch.scene import Scene

from support.cuda_on_cpu import FIBERS


def both(scene: Scene) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Passes and statistics, CPU's and CUDA's."""
    ours = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    cpu = render(scene)
    return cpu.passes, cpu.stats, ours.passes, ours.stats


def check_equal(name: str, cpu: Any, ours: Any, place: str) -> None:
    """fibers: but for the order of double sums. GPU: a few of its functions differ in the last bit, so a path may turn."""
    assert np.isfinite(ours).all(), name
    if place == FIBERS:
        np.testing.assert_allclose(ours, cpu, rtol=2e-6, atol=1e-7, err_msg=name)
        return
    differ = ~np.isclose(ours, cpu, rtol=1e-4, atol=1e-5)
    assert differ.mean() < 0.01, (name, differ.mean())


# luch::ShadowRay: whose it is, and whether it looks for occlusion, which has a channel of its own.
SHADOW_RAY = np.dtype({"names": ["path", "for_ao"], "formats": ["<u4", "u1"], "offsets": [36, 60], "itemsize": 64})


def watch_shadows(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Fails where two threads of one launch would add to the same path's sums, which are no atomic ones.

    Returns how many rays each launch added, so far.
    """
    launch, seen = DeviceRenderer._launch, list[int]()
    assert core.render.task_sizes()["shadow"] == SHADOW_RAY.itemsize

    def watched(self: DeviceRenderer, kernel: Any, turn: int, threads: int, *more: bytes) -> None:
        if kernel.name == "add_shadows":
            rays = np.frombuffer(self._memory.arrays["shadows"].get(), SHADOW_RAY)[:threads]
            paths = rays["path"][rays["for_ao"] == 0]
            assert len(np.unique(paths)) == len(paths), "one path twice"
            seen.append(len(paths))
        launch(self, kernel, turn, threads, *more)

    monkeypatch.setattr(DeviceRenderer, "_launch", watched)
    return seen

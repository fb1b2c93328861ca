"""One scene on the CPU and on CUDA, and how far their pictures may differ."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
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

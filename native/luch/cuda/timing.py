"""Where a GPU's time goes, pixel by pixel, for the Render Time pass; nothing of it runs unless that is asked for.

A kernel's time, by CUDA's events, is shared among paths as their threads counted clock cycles in it: waiting for memory
and for other lanes of the warp counts as theirs. What lies between those kernels (beginning paths, sorting, launches)
is shared in the same proportion, so that pixels add up to the time of tracing. Sharing takes some milliseconds a
wave by itself; they belong to no pixel, and not to the time of tracing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from luch.cuda.device import cupy

TIMED = ("-DLUCH_PLAN_TIME=1",)
CLOCKS = ("closest", "any", "media", "light", "surfaces", "walks", "exits", "shadows")  # WaveClock


class StageClocks:
    """Of the wave under way."""

    def __init__(self) -> None:
        self._runs: list[tuple[str, Any, Any]] = []
        self.charging_seconds = 0.0  # that sharing itself has taken

    @contextmanager
    def running(self, stage: str) -> Iterator[None]:
        """Around the launches of one of CLOCKS."""
        cp = cupy()
        began, ended = cp.cuda.Event(), cp.cuda.Event()
        began.record()
        yield
        ended.record()
        self._runs.append((stage, began, ended))

    def charge(self, memory: Any, those: Any, pixels: int, samples: int, seconds: float) -> None:
        """Adds a wave's seconds to its pixels in the film. The device must have ended it.

        memory: luch.cuda.memory.Memory; those: which pixels of the film, a slice or a list; so many samples of each.
        """
        began = time.perf_counter()
        try:
            self._share(memory, those, pixels, samples, seconds)
            cupy().cuda.get_current_stream().synchronize()
        finally:
            self.charging_seconds += time.perf_counter() - began

    def _share(self, memory: Any, those: Any, pixels: int, samples: int, seconds: float) -> None:
        cp = cupy()
        spent = dict.fromkeys(CLOCKS, 0.0)
        for stage, began, ended in self._runs:
            ended.synchronize()
            spent[stage] += float(cp.cuda.get_elapsed_time(began, ended))
        self._runs.clear()
        ticks, share = memory.arrays["ticks"], cp.zeros(memory.slots, np.float64)
        for index, stage in enumerate(CLOCKS):
            counted = float(ticks[index].sum(dtype=np.float64))
            if counted > 0.0:
                share += ticks[index] * (spent[stage] / counted)
        ticks.fill(0)
        whole = float(share.sum())
        if not whole > 0.0:
            return
        share *= 1000.0 * seconds / whole
        channel = memory.field("film.layout.time")
        parts = share.reshape(memory.layers, memory.layer_pixels)[:samples, :pixels]
        memory.rows[:samples, those, channel] += parts

"""Renders .luch scenes on a GPU: seconds, rays a second, seconds of each stage; the picture held against the CPU's.

    python tests/bench/device_render.py scene.luch ... [--scale 4] [--samples 32] [--cpu] [--output FILE.json]

Each scene is rendered three times: the first compiles its kernels, the second is timed, the third times every kernel by
events (which makes the whole a little slower). --cpu renders on the CPU too and counts pixels that differ.
"""

from __future__ import annotations

import argparse
import collections
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from luch.cuda import device
from luch.render import Result, render
from luch.scene import Scene
from luch.scenefile import read_scene


class StageTimes:
    """Measures every launch between entering and leaving."""

    def __enter__(self) -> StageTimes:
        self._events: dict[str, list[tuple[Any, Any]]] = collections.defaultdict(list)
        self._launch = device.Kernel.launch
        launch, events, cp = self._launch, self._events, device.cupy()

        def timed(kernel: device.Kernel, grid: int, block: int, arguments: list[bytes], shared_bytes: int = 0) -> None:
            begin, end = cp.cuda.Event(), cp.cuda.Event()
            begin.record()
            launch(kernel, grid, block, arguments, shared_bytes)
            end.record()
            events[kernel.name].append((begin, end))

        setattr(device.Kernel, "launch", timed)
        return self

    def __exit__(self, *error: object) -> None:
        setattr(device.Kernel, "launch", self._launch)

    def milliseconds(self) -> dict[str, float]:
        """Sum over all launches of each kernel, the dearest first."""
        cp = device.cupy()
        cp.cuda.Device().synchronize()
        sums = {
            name: sum(float(cp.cuda.get_elapsed_time(*pair)) for pair in pairs) for name, pairs in self._events.items()
        }
        return dict(sorted(sums.items(), key=lambda row: -row[1]))


def prepared(path: Path, scale: int, samples: int) -> Scene:
    """Combined alone, the frame enlarged, on CUDA."""
    scene = read_scene(path)
    film = replace(
        scene.film, width=scene.film.width * scale, height=scene.film.height * scale, border=None, passes=["Combined"]
    )
    settings = replace(scene.settings, samples=samples, time_limit=0.0, device="CUDA")
    return replace(scene, film=film, settings=settings)


def measured(path: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One scene's row."""
    scene = prepared(path, options.scale, options.samples)
    first = render(scene)
    begin = time.perf_counter()
    second = render(scene)
    seconds = time.perf_counter() - begin
    with StageTimes() as times:
        render(scene)
    stats = second.stats
    row = {
        "scene": path.stem,
        "pixels": scene.film.width * scene.film.height,
        "samples": options.samples,
        "compile_seconds": first.stats["kernel_compile_seconds"],
        "prepare_seconds": stats["prepare_seconds"],
        "render_seconds": stats["render_seconds"],
        "seconds": seconds,
        "mrays_per_s": (stats["rays"] + stats["shadow_rays"]) / stats["render_seconds"] / 1e6,
        "kernels": stats["kernels"],
        "milliseconds": times.milliseconds(),
    }
    return row | compared(scene, second) if options.cpu else row


def compared(scene: Scene, ours: Result) -> dict[str, Any]:
    """Against the CPU's picture."""
    cpu = render(replace(scene, settings=replace(scene.settings, device="CPU")))
    a, b = cpu.passes["Combined"], ours.passes["Combined"]
    return {
        "cpu_render_seconds": cpu.stats["render_seconds"],
        "pixels_that_differ": int((~np.isclose(a, b, rtol=1e-4, atol=1e-5)).any(-1).sum()),
        "relative_difference": float(np.abs(a - b)[..., :3].sum() / np.abs(a)[..., :3].sum()),
    }


def main() -> int:
    """Prints the rows; 1 where a picture differs from the CPU's."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--scale", type=int, default=4, help="frame sides times this")
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--cpu", action="store_true")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    rows = []
    for path in options.scenes:
        row = measured(path, options)
        rows.append(row)
        print(f"{row['scene']:24} {row['pixels']:9,} px {row['samples']:5} samples: {row['render_seconds']:.2f} s of "
              f"{row['seconds']:.2f}, {row['mrays_per_s']:.0f} Mrays/s, compiled in {row['compile_seconds']:.1f} s")  # fmt: skip
        print("   " + ", ".join(f"{name} {ms:.0f} ms" for name, ms in list(row["milliseconds"].items())[:8]))
        if options.cpu:
            print(f"   CPU {row['cpu_render_seconds']:.2f} s; {row['pixels_that_differ']} pixels differ")
    if options.output:
        options.output.write_text(json.dumps({"machine": device.describe(), "rows": rows}, indent=1), encoding="utf-8")
    return int(any(row.get("pixels_that_differ") for row in rows))


if __name__ == "__main__":
    sys.exit(main())

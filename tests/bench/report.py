"""What reports and the dial say, against renders of the whole picture: rows A9, A10 and A13 of the accuracy goals.

  build.py bench report SCENE.luch ... [--seconds 60] [--size 480] [--rounds 3] [--step GOOD]

A13  seconds that the report took, and those that it foretells for the whole picture; each effect's share of the time as
     the report says, and as renders of the whole picture with and without it say, in turns (processor time)
A9   bias of each choice as the report says, and as renders of the whole picture of many samples say (the same paths)
A10  seconds to a step's error by the dial, pilot included, and by each choice of the report alone

Writes out/bench/report.json.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import numpy as np  # noqa: E402
from luch.cuda import compiler  # noqa: E402
from luch.quality import CHOICES  # noqa: E402
from luch.render import render  # noqa: E402
from luch.report import Report, make_report  # noqa: E402
from luch.report.plan import plan  # noqa: E402
from luch.report.shots import Shot, scaled, shoot  # noqa: E402
from luch.report.tally import relative_error, weights  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.scenefile import read_scene  # noqa: E402
from luch.stopping import STEPS, UNLIMITED_SAMPLES  # noqa: E402

from luch.effects import effects_of  # noqa: E402 isort: skip

OUT = ROOT / "out" / "bench"


def timed(scene: Scene, samples: int) -> Shot:
    """On a GPU by the scene's own kernels."""
    while True:
        shot = shoot(scene, 1, samples, lambda: True)
        assert shot is not None
        if shot.settled:
            return shot
        compiler.quiet()


def spent(scene: Scene, samples: int) -> float:
    """Processor seconds of tracing, on a GPU those of the clock."""
    shot = timed(scene, samples)
    return shot.trace_seconds if shot.paths_to_fill else shot.trace_cpu_seconds


def foretold(report: Report, whole: Scene, samples: int) -> tuple[float, float]:
    """Seconds of tracing of the whole picture as the report has them, and as they are."""
    base = report.base_row
    assert base is not None
    told = base.sample_seconds / (report.width * report.height) * whole.film.pixels * samples
    true = timed(whole, samples).trace_seconds
    print(f"  seconds of {samples} samples of the whole picture: told {told:.2f}, true {true:.2f}", flush=True)
    return told, true


def shares(report: Report, whole: Scene, rounds: int, samples: int) -> list[dict[str, Any]]:
    """A13: effect by effect."""
    found = []
    for row in report.effects:
        without = replace(whole, settings=replace(whole.settings, without_effects=[row.effect]))
        ratios = [spent(without, samples) / spent(whole, samples) for _ in range(rounds)]
        share = 1.0 - float(np.median(ratios))
        found.append({"effect": row.effect, "told": row.cost_share, "low": 1.0 - row.cost_high,
                      "high": 1.0 - row.cost_low, "whole": share})  # fmt: skip
        print(f"  A13 {row.effect:28} told {row.cost_share:6.1%}, whole picture {share:6.1%}", flush=True)
    return found


def floors(report: Report, whole: Scene, samples: int) -> list[dict[str, Any]]:
    """A9: choice by choice, for those whose bias the report is sure of."""
    tried = {variant.name: variant for variant in plan(whole, effects_of(whole)).variants}
    pictures = {}
    found = []
    for row in report.choices:
        if not row.floor.sure or row.denoised or row.name not in tried:
            continue
        for name in ("exact", row.name):
            if name not in pictures:
                shot = shoot(tried[name].of(whole), 5, samples, lambda: True)
                assert shot is not None
                pictures[name] = shot.last.astype(np.float64)
        exact = pictures["exact"]
        bias = float(np.sqrt(relative_error(pictures[row.name], exact, weights(exact))))
        found.append({"choice": row.name, "told": row.floor_error, "whole": bias})
        print(f"  A9  {row.name:28} told {row.floor_error:6.2%}, whole picture {bias:6.2%}", flush=True)
    return found


def dial(scene: Scene, report: Report, step: str) -> dict[str, float]:
    """A10: seconds, pilot included, against those of each choice that the dial may take."""
    took: dict[str, float] = {}
    began = time.perf_counter()
    result = render(replace(scene, settings=replace(scene.settings, quality=step)))
    took["dial"] = time.perf_counter() - began
    print(f"  A10 {result.stats['quality']['reason']}: {took['dial']:.1f} s", flush=True)
    for row in report.choices:
        if row.name not in CHOICES | {report.base} or row.denoised or row.floor.high > STEPS[step]:
            continue
        noise = math.sqrt(STEPS[step] ** 2 - row.floor_relmse)  # bias and noise together make the error
        settings = replace(scene.settings, **{**row.settings, "error_limit": noise, "samples": UNLIMITED_SAMPLES})
        began = time.perf_counter()
        render(replace(scene, settings=settings))
        took[row.name] = time.perf_counter() - began
        print(f"  A10 {row.name:28} {took[row.name]:.1f} s", flush=True)
    return took


def main() -> int:
    parser = argparse.ArgumentParser(prog="build.py bench report", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--size", type=int, default=480, help="of the whole picture, its longer side")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--samples", type=int, default=4, help="of each; as many as keep a GPU busy")
    parser.add_argument("--device", type=str.upper, default="CPU", choices=("CPU", "CUDA"))
    parser.add_argument("--long", type=int, default=0, help="samples of A9's renders (default: left out)")
    parser.add_argument("--step", choices=tuple(STEPS), help="for A10 (default: left out)")
    options = parser.parse_args()
    told: dict[str, Any] = {}
    for path in options.scenes:
        whole = scaled(read_scene(path), options.size, enlarged=True)
        whole.settings.device = options.device
        began = time.perf_counter()
        report, _ = make_report(whole, options.seconds)
        print(f"{path.stem}: {time.perf_counter() - began:.1f} s at {report.width} x {report.height}", flush=True)
        told[path.stem] = {
            "seconds": time.perf_counter() - began,
            "A13": shares(report, whole, options.rounds, options.samples),
            "foretold": foretold(report, whole, options.samples),
            "A9": floors(report, whole, options.long) if options.long else [],
            "A10": dial(whole, report, options.step) if options.step else {},
        }
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "report.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What renders say of their error, against the truth: rows A2 to A8 of the accuracy goals.

For each scene, small, against a picture converged by Luch itself (its noise is taken out of every error):

  A2  (claimed error / true error)^2 from 32 samples on: median, part within 0.8..1.25; part whose 95 % interval holds
  A3  at 64 samples: part of pixels and channels whose 95 % interval holds; its width over the true error's, median; part
      of the pixels that Reliability flags; of those that are off by twice their interval, how many it flags
  A4  renders that end at an error asked for: true over asked, median, part within 0.7..1.1; samples taken
  A5  their brightness over the reference's, in per cent, with its standard error
  A6  the time to the error of four times the samples, from 64 on: median of |log(foretold / taken)|, part within 20 %,
      part whose 80 % interval holds
  A7  seconds over a time limit
  A8  seconds with the estimate over seconds without, interleaved, median
  adaptive  as A4 and A5, with samples where the error is
  --cycles  Cycles ended by its noise threshold against its own converged picture, and Luch asked for the same error

Writes out/bench/accuracy.json and, with --write, the table of docs/accuracy.md. Scenes are looked for as by
build.py bench scenes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "bench"), str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import bpy  # noqa: E402
import numpy as np  # noqa: E402
from luch import accuracy, image, pixel_error  # noqa: E402
from luch._native import core  # noqa: E402
from luch.curve import Curve, correction  # noqa: E402
from luch.render import render  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.stopping import looks_after  # noqa: E402
from scenes import SCENES, scenes_folder  # noqa: E402
from support.races import Truth, in_turns  # noqa: E402

import addon  # noqa: E402
from addon.engine import capture_scene  # noqa: E402
from buildtools.inside import session  # noqa: E402

OUT = ROOT / "out" / "bench"
PAGE = ROOT / "docs" / "accuracy.md"
BEGIN, END = "<!-- table: build.py bench accuracy -->", "<!-- end of table -->"
MOST = 256  # samples of A2 and A6
REFERENCE_SEED = 991
GROSS = 2.0  # times its interval: what a pixel is off when its interval is not to be believed
THRESHOLDS = 0.05, 0.01  # of Cycles; the latter is Blender's default
CYCLES_MOST = 2048  # samples


@dataclass
class Row:
    """One scene. Lists hold one value a render or a look."""

    scene: str
    width: int
    height: int
    reference_samples: int
    a2: list[float] = field(default_factory=list)
    a2_covered: list[bool] = field(default_factory=list)
    a3: list[float] = field(default_factory=list)
    a3_flagged: list[float] = field(default_factory=list)
    a3_gross: list[tuple[int, int]] = field(default_factory=list)
    a3_samples: int = 64
    a4: list[float] = field(default_factory=list)
    a4_samples: list[int] = field(default_factory=list)
    a5: list[float] = field(default_factory=list)
    a6: list[float] = field(default_factory=list)
    a6_covered: list[bool] = field(default_factory=list)
    a7: list[float] = field(default_factory=list)
    a8: list[float] = field(default_factory=list)
    adaptive: list[float] = field(default_factory=list)  # true over asked
    adaptive_samples: list[float] = field(default_factory=list)
    adaptive_brightness: list[float] = field(default_factory=list)
    cycles: list[dict[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.a3_noise: list[np.ndarray] = []
        self.a3_error: list[np.ndarray] = []

    @property
    def a3_width(self) -> float:
        """Claimed standard errors over the root of the pixels' mean squared errors, median."""
        true = np.sqrt(np.mean(self.a3_noise, axis=0))
        return float(np.median((np.mean(self.a3_error, axis=0) / np.maximum(true, 1e-12))[true > 0.0]))

    def cells(self) -> list[str]:
        """For the table."""
        a2, a4, a6 = np.array(self.a2), np.array(self.a4), np.abs(self.a6)
        bright = 100.0 * np.array(self.a5)
        return [
            self.scene,
            f"{np.median(a2):.2f}; {np.mean((a2 >= 0.8) & (a2 <= 1.25)):.0%}; {np.mean(self.a2_covered):.0%}",
            f"{np.mean(self.a3):.1%}; {self.a3_width:.2f}; {np.mean(self.a3_flagged):.0%}; {_of(self.a3_gross)}",
            f"{np.median(a4):.2f}; {np.mean((a4 >= 0.7) & (a4 <= 1.1)):.0%}; {np.median(self.a4_samples):.0f}",
            f"{bright.mean():+.2f} +- {bright.std() / np.sqrt(len(bright)):.2f}",
            f"{np.median(a6):.2f}; {np.mean(a6 <= np.log(1.2)):.0%}; {np.mean(self.a6_covered):.0%}",
            f"{1000.0 * max(self.a7):.0f} ms",
            f"{np.median(self.a8):.3f}",
            f"{np.median(self.adaptive):.2f}; {np.median(self.adaptive_samples):.0f}; "
            f"{100.0 * np.mean(self.adaptive_brightness):+.2f} +- "
            f"{100.0 * np.std(self.adaptive_brightness) / np.sqrt(len(self.adaptive_brightness)):.2f}",
        ]


def _of(counted: list[tuple[int, int]]) -> str:
    found, all_of_them = (sum(part) for part in zip(*counted, strict=True))
    return f"{found} of {all_of_them}"


HEADINGS = ["scene", "A2 ratio; in band; covered", "A3 covered; width; flagged; gross misses flagged", "A4 true/asked; in band; samples", "A5 brightness %",
            "A6 log ratio; in 20 %; covered", "A7 over", "A8 cost", "adaptive: true/asked; samples; brightness %"]  # fmt: skip


def opened(file: Path, size: int) -> Scene:
    """The file's own camera and frame, small."""
    scene = session.open_file(str(file), "LUCH")
    render_settings = scene.render
    longest = max(render_settings.resolution_x, render_settings.resolution_y)
    width, height = (
        max(8, round(extent * size / longest))
        for extent in (render_settings.resolution_x, render_settings.resolution_y)
    )
    session.choose_size(scene, width, height)
    captured = capture_scene(scene, bpy.context.view_layer)
    captured.film.passes = ["Combined"]
    addon.unregister()  # the next file registers it again
    return captured


def with_settings(scene: Scene, **settings: Any) -> Scene:
    return replace(scene, settings=replace(scene.settings, time_limit=0.0, **settings))


def reference_of(scene: Scene, name: str, samples: int) -> np.ndarray:
    """float64 (H, W, 3); kept in out/bench/accuracy for the next run."""
    film = scene.film
    file = OUT / "accuracy" / f"{name}-{film.width}x{film.height}-{samples}.npy"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        result = render(with_settings(scene, samples=samples, seed=REFERENCE_SEED))
        np.save(file, result.passes["Combined"][..., :3].astype(np.float64))
    return np.asarray(np.load(file))


def look_at(scene: Scene, truth: Truth, seed: int, row: Row) -> list[tuple[int, float]]:
    """A2 and A6 of one render; its true errors by samples."""
    renderer = core.render.Renderer(with_settings(scene, samples=MOST, seed=seed, estimate_error=True))
    renderer.prepare()
    curve, done, spent, seen = Curve(), 0, 0.0, []
    forecasts: dict[int, tuple[Curve, float]] = {}
    while done < MOST:
        following = min(looks_after(done), MOST)
        began = time.perf_counter()
        renderer.render(done, following - done)
        spent, done = spent + time.perf_counter() - began, following
        mean, deviation, share = renderer.deviations()
        found = accuracy.estimate(mean, deviation)
        assert found is not None
        curve.add(done, spent, found, share)
        error, told = truth.error(mean, done), curve.last
        assert told is not None
        seen.append((done, error))
        if done == row.a3_samples:
            add_pixels(mean, deviation, (share, curve.rate()[0]), truth, row)
        if done >= 32:
            row.a2.append((told.error / error) ** 2)
            row.a2_covered.append(told.error_low <= error <= told.error_high)
        if done == MOST // 4:
            kept = Curve()
            kept.points = list(curve.points)
            forecasts[done * 4] = (kept, spent)
        if done in forecasts:
            early, before = forecasts[done]
            ahead = early.forecast(error)
            row.a6.append(float(np.log((before + ahead.seconds) / spent)))
            row.a6_covered.append(ahead.seconds_low <= spent - before <= ahead.seconds_high)
    return seen


def end_at(scene: Scene, truth: Truth, asked: float, seed: int, row: Row) -> None:
    """A4 and A5 of one render."""
    result = render(with_settings(scene, samples=1 << 14, seed=seed, error_limit=asked))
    picture = result.passes["Combined"]
    row.a4.append(truth.error(picture, result.stats["samples"]) / asked)
    row.a4_samples.append(result.stats["samples"])
    row.a5.append(truth.brightness(picture))


def end_adaptively(scene: Scene, truth: Truth, asked: float, seed: int, row: Row) -> None:
    """The same error with samples where it is."""
    result = render(with_settings(scene, samples=1 << 14, seed=seed, error_limit=asked, adaptive=True))
    picture, samples = result.passes["Combined"], result.stats["samples_mean"]
    row.adaptive.append(truth.error(picture, samples) / asked)
    row.adaptive_samples.append(samples)
    row.adaptive_brightness.append(truth.brightness(picture))


def overshoot(scene: Scene, seconds: float) -> float:
    """A7: whole call, building included."""
    settings = replace(scene.settings, samples=1 << 20, time_limit=seconds)
    began = time.perf_counter()
    render(replace(scene, settings=settings))
    return time.perf_counter() - began - seconds


def cost(scene: Scene, pairs: int) -> list[float]:
    """A8: CPU seconds of renders with the estimate over those without."""

    def work(on: bool) -> Callable[[int], object]:
        return lambda pair: render(with_settings(scene, samples=64, seed=pair, estimate_error=on))

    return in_turns(work(True), work(False), pairs)


def add_pixels(mean: Any, deviation: Any, told: tuple[float, float], truth: Truth, row: Row) -> None:
    """A3 of one look. told: share of the samples before the mark, rate."""
    noise = np.abs(mean - truth.picture)
    error = pixel_error.standard_error(deviation, correction(*told)).astype(np.float64)
    # The reference has noise of its own, as if it were this picture's.
    error *= np.sqrt(1.0 + row.a3_samples / truth.samples)
    missed = noise > accuracy.NORMAL_95 * error + 1e-9
    gross = (noise > GROSS * accuracy.NORMAL_95 * error + 1e-9).any(axis=2)
    low = pixel_error.reliability(deviation)[..., 0] < 0.5
    row.a3.append(1.0 - float(missed.mean()))
    row.a3_flagged.append(float(low.mean()))
    row.a3_gross.append((int((gross & low).sum()), int(gross.sum())))
    row.a3_noise.append((mean - truth.picture) ** 2)
    row.a3_error.append(error)


def race(file: Path, options: argparse.Namespace) -> Row:
    scene = opened(file, options.size)
    truth = Truth(reference_of(scene, file.stem, options.reference), options.reference)
    row = Row(file.stem, scene.film.width, scene.film.height, options.reference)
    seen = [look_at(scene, truth, seed, row) for seed in range(options.seeds)]
    for samples in (48, 160):
        asked = float(np.median([np.interp(np.log(samples), *np.log(one).T) for one in seen]))
        for seed in range(options.seeds):
            end_at(scene, truth, float(np.exp(asked)), 100 + seed, row)
            end_adaptively(scene, truth, float(np.exp(asked)), 200 + seed, row)
    row.a7 = [overshoot(scene, seconds) for seconds in (1.0, 2.0)]
    row.a8 = cost(scene, options.pairs)
    if options.cycles:
        row.cycles = cycles_thresholds(file, scene, truth, row, options)
    return row


def cycles_picture(file: Path, row: Row, samples: int, seed: int, threshold: float) -> tuple[np.ndarray, float]:
    """Cycles' own picture of the file, nothing taken from its light: Combined, seconds."""
    scene = session.open_file(str(file), "CYCLES")
    session.choose_size(scene, row.width, row.height)
    session.choose_samples(scene, samples, seed=seed)
    cycles = scene.cycles
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = threshold > 0.0, threshold
    cycles.use_denoising, cycles.time_limit = False, 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    scene.render.use_persistent_data = scene.render.use_compositing = scene.render.use_sequencer = False
    taken = session.render_frame(scene)
    path = OUT / "accuracy" / "cycles.exr"
    session.save_result(scene, path)
    layers, _ = image.read_exr(path)
    named = {name.rpartition(".")[2]: pixels for name, pixels in layers.items()}
    return named["Combined"].astype(np.float64)[..., :3], taken.wall_s


def cycles_thresholds(
    file: Path, scene: Scene, truth: Truth, row: Row, options: argparse.Namespace
) -> list[dict[str, float]]:
    """Cycles stopped by its noise threshold, against its own converged picture; and Luch asked for that error."""
    kept = OUT / "accuracy" / f"{row.scene}-{row.width}x{row.height}-cycles-{options.reference}.npy"
    if not kept.exists():
        np.save(kept, cycles_picture(file, row, options.reference, REFERENCE_SEED, 0.0)[0])
    own = Truth(np.load(kept), options.reference)
    told = []
    for threshold in THRESHOLDS:
        picture, seconds = cycles_picture(file, row, CYCLES_MOST, 1, threshold)
        error = own.error(picture, 0)  # it tells nobody how many samples it took
        began = time.perf_counter()
        ours = render(with_settings(scene, samples=1 << 14, seed=1, error_limit=error))
        spent = time.perf_counter() - began
        combined = ours.passes["Combined"]
        told.append({
            "threshold": threshold, "error": error, "seconds": seconds,
            "brightness": own.brightness(picture), "energy": float(own.picture.mean() / truth.picture.mean()),
            "luch_error": truth.error(combined, ours.stats["samples"]), "luch_seconds": spent, "luch_brightness": truth.brightness(combined),
        })  # fmt: skip
    return told


CYCLES_HEADINGS = ["scene", "noise threshold", "Cycles: true error %; s; brightness %",
                   "Luch asked for that: true error %; s; brightness %", "energy, Cycles over Luch"]  # fmt: skip


def cycles_table(rows: list[Row]) -> str:
    lines = ["| " + " | ".join(CYCLES_HEADINGS) + " |", "|" + "---|" * len(CYCLES_HEADINGS)]
    for row in rows:
        for one in row.cycles:
            sides = [
                f"{100 * one[f'{who}error']:.2f}; {one[f'{who}seconds']:.1f}; {100 * one[f'{who}brightness']:+.2f}"
                for who in ("", "luch_")
            ]
            lines.append(f"| {row.scene} | {one['threshold']:g} | {sides[0]} | {sides[1]} | {one['energy']:.4f} |")
    return "\n".join(lines)


def table(rows: list[Row]) -> str:
    lines = ["| " + " | ".join(HEADINGS) + " |", "|" + "---|" * len(HEADINGS)]
    lines += ["| " + " | ".join(row.cells()) + " |" for row in rows]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(prog="build.py bench accuracy", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--scene", nargs="+", default=SCENES, metavar="NAME", help=f"default: {' '.join(SCENES)}")
    parser.add_argument("--size", type=int, default=160, help="long side, pixels")
    parser.add_argument("--seeds", type=int, default=8, help="renders of each kind")
    parser.add_argument("--pairs", type=int, default=5, help="pairs of renders that A8 compares")
    parser.add_argument("--reference", type=int, default=8192, help="samples of the converged picture")
    parser.add_argument("--cycles", action="store_true", help="Cycles' noise threshold beside, on the same scenes")
    parser.add_argument("--write", action="store_true", help="put the table into docs/accuracy.md")
    options = parser.parse_args()
    folder = scenes_folder()
    if folder is None:
        print("no scenes: no shared/scenes beside the checkout and LUCH_SCENES is not set; nothing was measured")
        return 2
    rows = []
    for name in options.scene:
        print(f"{name} ...", flush=True)
        rows.append(race(folder / f"{name}.blend", options))
        print(table(rows), flush=True)
        if options.cycles:
            print(cycles_table(rows), flush=True)
    OUT.mkdir(parents=True, exist_ok=True)
    report = {"processors": os.cpu_count(), "options": vars(options), "rows": [asdict(row) for row in rows]}
    (OUT / "accuracy.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if options.write:
        page = PAGE.read_text(encoding="utf-8")
        before, after = page.partition(BEGIN)[0], page.partition(END)[2]
        what = f"{options.size} pixels wide, {options.seeds} seeds, reference of {options.reference} samples\n\n"
        beside = f"\n\n{cycles_table(rows)}" if options.cycles else ""
        PAGE.write_text(f"{before}{BEGIN}\n{what}{table(rows)}{beside}\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

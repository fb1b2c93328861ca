"""What renders say of their error, against the truth: rows A2 to A8 of the accuracy goals.

For each scene, small, against a picture converged by Luch itself (its noise is taken out of every error):

  A2  claimed error over true error from 32 samples on: the square's median; part of the looks of which the error lies
      within 0.8..1.25, and of which its square does; part whose 95 % interval holds. Over all scenes also the part of
      the cases (scene, sampler, samples) of which the squares' means over the seeds do
  A3  at 64 samples: part of pixels and channels whose 95 % interval holds; its width over the true error's, median; part
      of the pixels that Reliability flags; of those that are off by twice their interval, how many it flags
  A4  renders that end at an error asked for: true over asked, median, part within 0.7..1.1; samples taken
  A5  their brightness over the reference's, in per cent, with its standard error
  A6  the time to the error of four times the samples, from 64 and from 256, and of sixteen times, from 64: median of
      |log(foretold / taken)|, part within 20 %, part whose 80 % interval holds
  A7  seconds over a time limit
  A8  seconds with the estimate over seconds without, interleaved, median
  adaptive  as A4 and A5, with samples where the error is
  --cycles  Cycles ended by its noise threshold against its own converged picture, and Luch asked for the same error

--sampler takes several families of points, a row for each scene and family, all against one reference.
After every row it rewrites out/bench/accuracy.json and, with --write, the tables of docs/accuracy.md. --append keeps the
rows that are there, of the same code and options, and measures those that are missing; --seconds begins no row after so
long: several short calls fill one table. Scenes are looked for as by build.py bench scenes.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "bench"), str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import numpy as np  # noqa: E402
from accuracy_page import FILE, Kept, Row, report, write_page_from  # noqa: E402
from luch import accuracy, image, pixel_error, samplers  # noqa: E402
from luch._native import core  # noqa: E402
from luch.cuda.several import renderer_for  # noqa: E402
from luch.curve import Curve, correction  # noqa: E402
from luch.render import render  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.scenefile import read_scene, write_scene  # noqa: E402
from luch.stopping import CUSTOM, looks_after  # noqa: E402
from support.races import Truth, in_turns  # noqa: E402

OUT = ROOT / "out" / "bench"
MOST = 1024  # samples of A6; with --only-looks as many as A2 asks for
SEEN = 32, 256  # samples of the looks that A2 asks for
AHEAD = (64, 4), (256, 4), (64, 16)  # forecasts that A6 asks for: samples, and how many times as many
PIXELS_AT = 64  # samples of A3
REFERENCE_SEEDS = 991, 992
OPTIONS = "size", "seeds", "pairs", "reference", "device"  # that rows of one table have in common
GROSS = 2.0  # times its interval: what a pixel is off when its interval is not to be believed
THRESHOLDS = 0.05, 0.01  # of Cycles; the latter is Blender's default
CYCLES_MOST = 2048  # samples


def opened(file: Path, size: int) -> Scene:
    """The file's own camera and frame, small; of a .luch file as it was captured."""
    if file.suffix == ".luch":
        return read_scene(file)
    import bpy

    import addon
    from addon.engine import capture_scene
    from buildtools.inside import session

    try:
        scene = session.open_file(str(file), "LUCH")
        render_settings = scene.render
        longest = max(render_settings.resolution_x, render_settings.resolution_y)
        width, height = (
            max(8, round(extent * size / longest))
            for extent in (render_settings.resolution_x, render_settings.resolution_y)
        )
        session.choose_size(scene, width, height)
        captured = capture_scene(scene, bpy.context.view_layer)
    finally:
        addon.unregister()  # the next file registers it again
    captured.film.passes = ["Combined"]
    return captured


def with_settings(scene: Scene, **settings: Any) -> Scene:
    """What a file asks for beside (an end, a dial, a denoiser) is left out."""
    plain = {"time_limit": 0.0, "error_limit": 0.0, "adaptive": False, "denoise": False, "quality": CUSTOM}
    return replace(scene, settings=replace(scene.settings, **(plain | settings)))


def shot(scene: Scene, **settings: Any) -> Any:
    """A render on the device that was asked for, and on no other."""
    asked = with_settings(scene, **settings)
    result = render(asked)
    if not result.stats["device"].startswith(asked.settings.device):
        raise RuntimeError("; ".join(result.stats["warnings"]))
    return result


def converged(scene: Scene, name: str, samples: int, device: str) -> Truth:
    """Two halves, kept in out/bench/accuracy for the next run; what they differ by is what the picture errs by.

    device: what renders them; the pictures are the same.
    """
    film = scene.film
    file = OUT / "accuracy" / f"{name}-{film.width}x{film.height}-{samples}-halves.npy"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        plain = with_settings(scene, samples=samples // 2, sampler=samplers.DEFAULT, device=device)
        halves = [shot(plain, seed=seed).passes["Combined"] for seed in REFERENCE_SEEDS]
        np.save(file, np.stack(halves)[..., :3].astype(np.float64))
    one, other = np.load(file)
    picture = (one + other) / 2.0
    return Truth(picture, samples, float(np.mean((one - other) ** 2 / (np.abs(picture) + accuracy.DARK) ** 2) / 4.0))


class Pixels:
    """A3: what renders of one scene say of their pixels."""

    def __init__(self, truth: Truth, row: Row) -> None:
        self.truth, self.row = truth, row
        self.noise: list[np.ndarray] = []
        self.told: list[np.ndarray] = []

    def add(self, mean: Any, deviation: Any, told: tuple[float, float], error: float) -> None:
        """One look. told: share of the samples before the mark, rate; error: the picture's true one."""
        row, noise = self.row, np.abs(mean - self.truth.picture)
        own = pixel_error.standard_error(deviation, correction(*told)).astype(np.float64)
        # The reference has noise of its own, as if it lay where this picture's does.
        own *= np.sqrt(1.0 + self.truth.noise_beside(error, PIXELS_AT))
        missed = noise > accuracy.NORMAL_95 * own + 1e-9
        gross = (noise > GROSS * accuracy.NORMAL_95 * own + 1e-9).any(axis=2)
        low = pixel_error.reliability(deviation)[..., 0] < 0.5
        row.a3.append(1.0 - float(missed.mean()))
        row.a3_flagged.append(float(low.mean()))
        row.a3_gross.append((int((gross & low).sum()), int(gross.sum())))
        self.noise.append(noise**2)
        self.told.append(own)

    @property
    def width(self) -> float:
        """Claimed standard errors over the root of the pixels' mean squared errors, median."""
        true = np.sqrt(np.mean(self.noise, axis=0))
        return float(np.median((np.mean(self.told, axis=0) / np.maximum(true, 1e-12))[true > 0.0]))


def look_at(scene: Scene, truth: Truth, seed: int, row: Row, pixels: Pixels, most: int) -> list[tuple[int, float]]:
    """A2 and A6 of one render; its true errors by samples."""
    settled = with_settings(scene, samples=most, seed=seed, estimate_error=True)
    renderer = renderer_for(settled) if scene.settings.device == "CUDA" else core.render.Renderer(settled)
    renderer.prepare()
    curve, done, spent, seen = Curve(scene.settings.sampler), 0, 0.0, []
    kept: dict[int, tuple[Curve, float]] = {}
    while done < most:
        following = min(looks_after(done), most)
        began = time.perf_counter()
        renderer.render(done, following - done)
        spent, done = spent + time.perf_counter() - began, following
        mean, deviation, share = renderer.deviations()
        found = accuracy.estimate(mean, deviation, share)
        assert found is not None
        curve.add(done, spent, found, share)
        error, told = truth.error(mean, done), curve.last
        assert told is not None
        seen.append((done, error))
        if done == PIXELS_AT:
            pixels.add(mean, deviation, (share, curve.rate()[0]), error)
        if SEEN[0] <= done <= SEEN[1]:
            row.a2.append((done, told.error, error))
            row.a2_covered.append(told.error_low <= error <= told.error_high)
        for first, times in AHEAD:
            if done == first:
                kept[done] = Curve(scene.settings.sampler), spent
                kept[done][0].points = list(curve.points)
            if done == first * times:
                early, before = kept[first]
                ahead = early.forecast(error)
                told_and_held = row.a6 if times == 4 else row.a6_far
                told_and_held.append((
                    float(np.log((before + ahead.seconds) / spent)),
                    ahead.seconds_low <= spent - before <= ahead.seconds_high,
                ))  # fmt: skip
    return seen


def end_at(scene: Scene, truth: Truth, asked: float, seed: int, row: Row) -> None:
    """A4 and A5 of one render."""
    result = shot(scene, samples=1 << 14, seed=seed, error_limit=asked)
    picture = result.passes["Combined"]
    row.a4.append(truth.error(picture, result.stats["samples"]) / asked)
    row.a4_samples.append(result.stats["samples"])
    row.a5.append(truth.brightness(picture))


def end_adaptively(scene: Scene, truth: Truth, asked: float, seed: int, row: Row) -> None:
    """The same error with samples where it is."""
    result = shot(scene, samples=1 << 14, seed=seed, error_limit=asked, adaptive=True)
    picture, samples = result.passes["Combined"], result.stats["samples_mean"]
    row.adaptive.append(truth.error(picture, samples) / asked)
    row.adaptive_samples.append(samples)
    row.adaptive_brightness.append(truth.brightness(picture))


def overshoot(scene: Scene, seconds: float) -> float:
    """A7: whole call, building included."""
    began = time.perf_counter()
    shot(scene, samples=1 << 20, time_limit=seconds)
    return time.perf_counter() - began - seconds


def cost(scene: Scene, pairs: int) -> list[float]:
    """A8: seconds of renders with the estimate over those without; on the CPU those of its processors."""

    def work(on: bool) -> Callable[[int], object]:
        return lambda pair: shot(scene, samples=64, seed=pair, estimate_error=on)

    clock = time.perf_counter if scene.settings.device == "CUDA" else time.process_time
    return in_turns(work(True), work(False), pairs, clock)


def race(scene: Scene, name: str, sampler: str, options: argparse.Namespace) -> Row:
    """Everything about one scene and sampler."""
    truth = converged(scene, name, options.reference, options.reference_device or options.device)
    row = Row(name, sampler, scene.film.width, scene.film.height)
    pixels = Pixels(truth, row)
    most = SEEN[1] if options.only_looks else MOST
    seen = [look_at(scene, truth, seed, row, pixels, most) for seed in range(options.seeds)]
    row.a3_width = pixels.width
    if options.only_looks:
        return row
    for samples in (48, 160):
        asked = float(np.median([np.interp(np.log(samples), *np.log(one).T) for one in seen]))
        for seed in range(options.seeds):
            end_at(scene, truth, float(np.exp(asked)), 100 + seed, row)
            end_adaptively(scene, truth, float(np.exp(asked)), 200 + seed, row)
    row.a7 = [overshoot(scene, seconds) for seconds in (1.0, 2.0)]
    row.a8 = cost(scene, options.pairs)
    return row


def cycles_picture(file: Path, row: Row, samples: int, seed: int, threshold: float) -> tuple[np.ndarray, float]:
    """Cycles' own picture of the file, nothing taken from its light: Combined, seconds."""
    from buildtools.inside import session

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


def cycles_thresholds(file: Path, scene: Scene, row: Row, options: argparse.Namespace) -> list[dict[str, float]]:
    """Cycles stopped by its noise threshold, against its own converged picture; and Luch asked for that error."""
    kept = OUT / "accuracy" / f"{row.scene}-{row.width}x{row.height}-cycles-{options.reference}.npy"
    if not kept.exists():
        np.save(kept, cycles_picture(file, row, options.reference, REFERENCE_SEEDS[0], 0.0)[0])
    truth = converged(scene, row.scene, options.reference, options.reference_device or options.device)
    own = Truth(np.load(kept), options.reference)
    told = []
    for threshold in THRESHOLDS:
        picture, seconds = cycles_picture(file, row, CYCLES_MOST, 1, threshold)
        error = own.error(picture, 0)  # it tells nobody how many samples it took
        began = time.perf_counter()
        ours = shot(scene, samples=1 << 14, seed=1, error_limit=error)
        spent = time.perf_counter() - began
        combined = ours.passes["Combined"]
        told.append({
            "threshold": threshold, "error": error, "seconds": seconds,
            "brightness": own.brightness(picture), "energy": float(own.picture.mean() / truth.picture.mean()),
            "luch_error": truth.error(combined, ours.stats["samples"]), "luch_seconds": spent, "luch_brightness": truth.brightness(combined),
        })  # fmt: skip
    return told


def main() -> int:
    parser = argparse.ArgumentParser(prog="build.py bench accuracy", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--scene", nargs="+", metavar="NAME", help="default: those of build.py bench scenes")
    parser.add_argument("--size", type=int, default=160, help="long side, pixels")
    parser.add_argument("--seeds", type=int, default=8, help="renders of each kind")
    parser.add_argument("--pairs", type=int, default=5, help="pairs of renders that A8 compares")
    parser.add_argument("--reference", type=int, default=8192, help="samples of the converged picture")
    parser.add_argument("--cycles", action="store_true", help="Cycles' noise threshold beside, on the same scenes")
    parser.add_argument(
        "--only-looks", action="store_true", help="A2, A3 and A6 of four times as many samples, no more"
    )
    parser.add_argument("--only-cycles", action="store_true", help="no rows of Luch's own")
    parser.add_argument(
        "--capture", type=Path, metavar="FOLDER", help="write the scenes, small, as .luch files, and end"
    )
    parser.add_argument("--captured", type=Path, metavar="FOLDER", help="read them: needs no Blender")
    parser.add_argument("--from", dest="sources", nargs="+", type=Path, metavar="JSON",
                        help="measure nothing: make the page of what several calls kept")  # fmt: skip
    parser.add_argument("--sampler", nargs="+", type=str.upper, default=[samplers.DEFAULT], choices=samplers.NAMES)
    parser.add_argument("--device", type=str.upper, default="CPU", choices=("CPU", "CUDA"), help="what renders")
    parser.add_argument("--reference-device", type=str.upper, choices=("CPU", "CUDA"), help="default: --device")
    parser.add_argument("--append", action="store_true", help="keep what out/bench/accuracy.json has of this code")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no row after so long")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/accuracy.md")
    options = parser.parse_args()
    if options.sources:
        write_page_from(options.sources)
        return 0
    files = scene_files(options)
    if not files:
        print("no scenes: no shared/scenes beside the checkout and LUCH_SCENES is not set; nothing was measured")
        return 2
    if options.capture:
        options.capture.mkdir(parents=True, exist_ok=True)
        for file in files:
            write_scene(opened(file, options.size), options.capture / f"{file.stem}.luch")
        return 0
    kept = Kept({name: getattr(options, name) for name in OPTIONS}, options.append)
    failed = measure(files, options, kept)
    print(f"{len(kept.rows)} rows in {FILE}" + (f"; failed: {', '.join(failed)}" if failed else ""))
    if kept.rows:
        print(report(kept.rows, kept.what))
    return 1 if failed else 0


def scene_files(options: argparse.Namespace) -> list[Path]:
    """Of the scenes that were asked for; none where there are none."""
    if options.captured:
        return (
            [options.captured / f"{name}.luch" for name in options.scene]
            if options.scene
            else sorted(options.captured.glob("*.luch"))
        )
    from scenes import SCENES, scenes_folder

    folder = scenes_folder()
    return [] if folder is None else [folder / f"{name}.blend" for name in options.scene or SCENES]


def measure(files: list[Path], options: argparse.Namespace, kept: Kept) -> list[str]:
    """The rows that are missing; the names of those that could not be measured."""
    failed, ends = [], time.monotonic() + options.seconds
    for file in files:
        name = file.stem
        for sampler in options.sampler[:1] if options.only_cycles else options.sampler:
            if kept.has(name, sampler):
                continue
            if time.monotonic() > ends:
                print("The time is over; call again with --append for the rest.")
                return failed
            print(f"{name}, {sampler} ...", flush=True)
            try:
                kept.add(row_of(file, sampler, options, not kept.has_cycles(name)))
            except (RuntimeError, OSError, ValueError) as error:
                failed.append(f"{name}, {sampler}")
                print(f"{failed[-1]}: {error}", flush=True)
                continue
            print(report(kept.rows[-1:], kept.what), flush=True)
            if options.write:
                kept.write_page()
    return failed


def row_of(file: Path, sampler: str, options: argparse.Namespace, first: bool) -> Row:
    """first: of this scene; Cycles has one sampler."""
    scene = opened(file, options.size)
    scene.settings.device, scene.settings.sampler = options.device, sampler
    film = scene.film
    row = (
        Row(file.stem, sampler, film.width, film.height)
        if options.only_cycles
        else race(scene, file.stem, sampler, options)
    )
    if (options.cycles or options.only_cycles) and first:
        row.cycles = cycles_thresholds(file, scene, row, options)
    return row


if __name__ == "__main__":
    sys.exit(main())

"""Error against time in three plain boxes, beside Cycles and, where it is installed, Mitsuba: row A12 of the goals.

A box with matt blocks, one with rough metal blocks, one with a glass ball under its lamp (tests/support/plain_boxes.py).
Every engine gets the same geometry, light, camera, filter (box, one pixel) and bounces; nothing is clamped, filtered,
denoised or sampled adaptively. For each box and engine:

  relMSE       mean of (I - R)^2 / (|R| + 0.01)^2 over pixels and channels, R the engine's own converged picture, whose
               noise is taken out; mean over seeds
  ms a sample  CPU seconds of all threads for a picture of --samples less those for a quarter of them, over the
               samples between: building, exporting, compiling and starting are left out for all alike; median over turns
  product      relMSE times the seconds that --samples take so; the smaller, the better
  over Luch    the engine's product over Luch's, with its 95 % interval by drawing turns anew (bootstrap)

Engines take turns, each turn begun by another. Luch and Cycles render in this process through Blender, Mitsuba in one of
its own: --mitsuba names a folder in which it is installed with numpy (pip install --target), or none if this Python has
it. It takes the LLVM variant, or says why not, with its independent and its multijittered sampler.
Writes out/bench/boxes.json, pictures beside it, and with --write the table in docs/accuracy.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]  # scenes/ before this folder's scenes.py

import boxes_page  # noqa: E402
import numpy as np  # noqa: E402
from boxes_page import Row, Shots  # noqa: E402
from luch.accuracy import DARK  # noqa: E402
from support import pictures, plain_boxes  # noqa: E402
from support.checkout import commit  # noqa: E402
from support.plain_boxes import BOXES, Box  # noqa: E402
from support.races import F64, Truth  # noqa: E402

OUT = ROOT / "out" / "bench" / "boxes"
REFERENCE_SEEDS = 991, 992
MITSUBA_SAMPLERS = {"Mitsuba": "independent", "Mitsuba, multijittered": "multijitter"}
MITSUBA_AT_ONCE = 256  # samples of converged pictures; it keeps a path for each in memory
FEWER = 4  # times, in the picture whose seconds are taken off
SAME_LIGHT = 0.005  # of the converged pictures' means

Picture = Callable[[int, int], tuple[F64, float]]  # samples, seed: pixels, top row first, and CPU seconds


def blender_engine(scene: Any, engine: str) -> Picture:
    """Luch or Cycles in the scene that is open."""
    from buildtools.inside import session

    def picture(samples: int, seed: int) -> tuple[F64, float]:
        scene.render.engine = engine
        session.choose_samples(scene, samples, seed=seed)
        taken = session.render_frame(scene)
        file = OUT / "last.exr"
        session.save_result(scene, file)
        return pictures.read_passes(file)["Combined"][..., :3].astype(np.float64), taken.cpu_s

    return picture


class Mitsuba:
    """A process that renders boxes. Raises RuntimeError, with the reason, where it does not start."""

    def __init__(self, folder: str, threads: int) -> None:
        """folder: where it is installed; "": where this Python looks."""
        environment = {**os.environ, "PYTHONPATH": folder}
        script = Path(__file__).with_name("_boxes_mitsuba.py")
        self.process = subprocess.Popen([sys.executable, str(script), str(threads)], env=environment, text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip
        told = self._answer()
        self.name = f"Mitsuba {told['version']}, {told['variant']}"
        if told["why"]:
            print(f"{self.name}: {told['why']}")

    def _answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"its process ended with {self.process.wait()}")
        return dict(json.loads(line))

    def engine(self, box: Box, sampler: str, options: argparse.Namespace) -> Picture:
        def picture(samples: int, seed: int) -> tuple[F64, float]:
            file = OUT / "last.npy"
            asked = {"box": box.name, "size": options.size, "bounces": options.bounces, "sampler": sampler,
                     "samples": samples, "seed": seed, "output": str(file)}  # fmt: skip
            assert self.process.stdin is not None
            print(json.dumps(asked), file=self.process.stdin, flush=True)
            spent = float(self._answer()["cpu_s"])
            return np.load(file).astype(np.float64), spent

        return picture

    def close(self) -> None:
        """Ends the process."""
        self.process.communicate()


def in_parts(picture: Picture, at_once: int) -> Picture:
    """The mean of pictures of so many samples at most, each with a seed of its own."""

    def whole(samples: int, seed: int) -> tuple[F64, float]:
        parts = [picture(min(at_once, samples - done), 1000 * seed + done) for done in range(0, samples, at_once)]
        weights = [min(at_once, samples - done) for done in range(0, samples, at_once)]
        pixels = np.average([pixels for pixels, _ in parts], axis=0, weights=weights)
        return pixels, sum(cpu_s for _, cpu_s in parts)

    return whole


def converged(name: str, picture: Picture, options: argparse.Namespace) -> Truth:
    """Two halves, kept in out/bench/boxes for the next run; what they differ by is what the picture errs by."""
    sources = [plain_boxes.__file__, str(ROOT / "tests" / "scenes" / "plain_boxes.py")]
    described = b"".join(Path(file).read_bytes() for file in sources)
    key = hashlib.sha256(described + f"{options.size} {options.bounces}".encode()).hexdigest()[:8]
    file = OUT / f"{name}-{options.reference}-{key}-halves.npy"
    if not file.exists():
        print(f"{name}: converged picture ...", flush=True)
        np.save(file, np.stack([picture(options.reference // 2, seed)[0] for seed in REFERENCE_SEEDS]))
    one, other = np.load(file)
    mean = (one + other) / 2.0
    return Truth(mean, options.reference, float(np.mean((one - other) ** 2 / (np.abs(mean) + DARK) ** 2) / 4.0))


def shoot(picture: Picture, truth: Truth, options: argparse.Namespace, seed: int, shots: Shots) -> F64:
    """One engine's part of a turn."""
    few = options.samples // FEWER
    _, before = picture(few, seed)
    pixels, spent = picture(options.samples, seed)
    shots.errors.append(truth.error(pixels, options.samples) ** 2)
    shots.seconds.append((spent - before) / (options.samples - few) * options.samples)
    shots.brightness.append(truth.brightness(pixels))
    return pixels


def race(box: Box, mitsuba: Mitsuba | None, options: argparse.Namespace) -> Row:
    """Everything about one box."""
    from scenes.plain_boxes import build

    scene = build(box, options.size, options.bounces, options.threads)
    engines = {"Luch": blender_engine(scene, "LUCH"), "Cycles": blender_engine(scene, "CYCLES")}
    truths = {name: converged(f"{box.name}-{name}", picture, options) for name, picture in engines.items()}
    if mitsuba is not None:
        own = {name: mitsuba.engine(box, sampler, options) for name, sampler in MITSUBA_SAMPLERS.items()}
        truth = converged(f"{box.name}-Mitsuba", in_parts(own["Mitsuba, multijittered"], MITSUBA_AT_ONCE), options)
        engines, truths = engines | own, truths | dict.fromkeys(own, truth)
    row = Row(box.name, options.samples, {name: Shots(truths[name].noise or 0.0) for name in engines})
    for name, picture in engines.items():
        picture(options.samples // FEWER, 1)  # compiled, cached
        row.shots[name].energy = [float(v) for v in pictures.energy_ratio(truths[name].picture, truths["Luch"].picture)]
    names = list(engines)
    for turn in range(options.turns):
        first = turn % len(names)
        for name in names[first:] + names[:first]:
            pixels = shoot(engines[name], truths[name], options, turn + 1, row.shots[name])
            if turn == 0:
                pictures.write_png(OUT / f"{box.name}-{name}.png".replace(", ", "-"), enlarged(pixels))
    return row


def enlarged(pixels: F64) -> np.ndarray:
    """To look at."""
    return np.kron(pictures.to_display(pixels.astype(np.float32)), np.ones((4, 4, 1), np.uint8))


def start_mitsuba(options: argparse.Namespace) -> Mitsuba | None:
    """None, and said so, where it was not asked for or does not start."""
    if options.mitsuba is None:
        print("Mitsuba is left out: --mitsuba FOLDER names where it is installed.")
        return None
    try:
        return Mitsuba(options.mitsuba, options.threads or os.cpu_count() or 1)
    except RuntimeError as error:
        print(f"Mitsuba is left out: {error}.")
        return None


def faults(rows: list[Row]) -> list[str]:
    """What makes figures of a row mean something else than they say."""
    told = []
    for row in rows:
        for name, shots in row.shots.items():
            if not all(abs(ratio - 1.0) <= SAME_LIGHT for ratio in shots.energy):
                told.append(f"{row.box}: {name} has other light than Luch, {shots.energy}")
            if not shots.noise <= boxes_page.MOST_NOISE * shots.error:
                told.append(f"{row.box}, {name}: the converged picture is too noisy, take more samples for --reference")
    return told


def main() -> int:
    """1 where engines do not show the same box or a converged picture is not converged."""
    parser = argparse.ArgumentParser(prog="build.py bench boxes", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--box", nargs="+", default=list(BOXES), choices=list(BOXES))
    parser.add_argument("--size", type=int, default=96, help="pixels of both sides")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--bounces", type=int, default=16)
    parser.add_argument("--turns", type=int, default=8, help="pictures of each engine, each with a seed of its own")
    parser.add_argument("--reference", type=int, default=6144, help="samples of the converged pictures")
    parser.add_argument(
        "--threads", type=int, default=1, help="of each engine; 0: all. With one none waits for another"
    )
    parser.add_argument("--mitsuba", nargs="?", const="", metavar="FOLDER", help="race Mitsuba too")
    parser.add_argument("--write", action="store_true", help="put the table into docs/accuracy.md")
    parser.add_argument("--from", dest="sources", nargs="+", type=Path, metavar="JSON",
                        help="measure nothing: put what calls kept into docs/accuracy.md")  # fmt: skip
    options = parser.parse_args()
    if options.sources:
        boxes_page.write(*boxes_page.read(options.sources))
        return 0
    from buildtools.inside import session

    OUT.mkdir(parents=True, exist_ok=True)
    session.open_file(None, "LUCH")
    mitsuba = start_mitsuba(options)
    what = {"size": options.size, "samples": options.samples, "turns": options.turns, "threads": options.threads,
            "reference": options.reference, "bounces": options.bounces, "commit": commit(),
            "mitsuba": mitsuba and mitsuba.name}  # fmt: skip
    rows: list[Row] = []
    for name in options.box:
        rows.append(race(BOXES[name], mitsuba, options))
        told = {"what": what, "rows": [asdict(row) for row in rows]}
        OUT.with_suffix(".json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        print(boxes_page.table(rows[-1:]), flush=True)
    if mitsuba is not None:
        mitsuba.close()
    wrong = faults(rows)
    print(boxes_page.report(rows, what), *wrong, sep="\n")
    if options.write and not wrong:
        boxes_page.write(rows, what)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

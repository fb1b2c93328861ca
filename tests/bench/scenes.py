"""Luch against Cycles on real scenes: bias, energy, and the time to Cycles' error at 64 samples.

For each scene, beside a converged reference (8,192 samples by Cycles):

  bias    relMSE once noise is gone: the cross product of two independent renders' differences from the
          reference, less the reference's own noise (the same cross product of two Cycles renders)
  energy  mean of each channel over the reference's
  time    seconds (wall; CPU of all threads) that Luch needs for the error Cycles has at 64 samples,
          from renders at about that error, over Cycles' own seconds in the same run, each in its own
          process, one after another, everything after opening the file included

Writes a table, out/bench/scenes.json and out/bench/NAME.png (Luch | reference | 10 x difference).
Scenes are looked for in shared/scenes beside the checkout, or where LUCH_SCENES points.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from support import pictures  # noqa: E402

F32 = NDArray[np.float32]
SCENES = [
    "cornell_box", "veach_mis", "modern_hall", "white_room", "conference_room", "little_lamp",
    "material_testball_hdri", "stanford_dragon", "stone_knight_dof", "bmw27", "sponza_1024_lights", "cesium_man_blur",
]  # fmt: skip
OUT = ROOT / "out" / "bench"
CYCLES_SAMPLES = 64
PILOT_SAMPLES = 16
MAX_BIAS, MAX_ENERGY_ERROR, MAX_TIME_RATIO = 1e-3, 0.01, 1.5


@dataclass
class Frame:
    """The full frame's size and the window of it that is rendered, in pixels."""

    width: int
    height: int
    window: tuple[int, int, int, int]

    def name(self) -> str:
        x0, y0, x1, y1 = self.window
        return f"{self.width}x{self.height}" + ("" if x1 - x0 == self.width else f"-part{x1 - x0}x{y1 - y0}")


@dataclass
class Shot:
    """One finished render."""

    samples: int
    wall_s: float
    cpu_s: float
    peak_mib: float
    picture: F32
    statistics: dict[str, Any]


@dataclass
class Row:
    """What is printed and stored for one scene."""

    scene: str
    width: int
    height: int
    cycles_wall_s: float
    cycles_cpu_s: float
    cycles_error: float
    samples: int
    wall_s: float
    cpu_s: float
    error: float
    wall_to_error_s: float
    cpu_to_error_s: float
    time_ratio: float
    cpu_ratio: float
    bias: float
    bias_uncertainty: float
    reference_noise: float
    energy: list[float]
    cycles_energy: list[float]
    peak_mib: float
    cycles_peak_mib: float
    warnings: list[str]

    def verdict(self) -> str:
        faults = []
        if not self.bias <= MAX_BIAS:
            faults.append("bias")
        if not all(abs(ratio - 1) <= MAX_ENERGY_ERROR for ratio in self.energy):
            faults.append("energy")
        if not self.time_ratio <= MAX_TIME_RATIO:
            faults.append("time")
        return ", ".join(faults) or "ok"


def scenes_folder() -> Path | None:
    """shared/scenes of the nearest folder above the checkout that has one; LUCH_SCENES wins."""
    named = os.environ.get("LUCH_SCENES")
    candidates = [Path(named)] if named else [folder / "shared" / "scenes" for folder in ROOT.parents]
    return next((folder for folder in candidates if (folder / "reference").is_dir()), None)


def shoot(file: Path, engine: str, samples: int, seed: int, frame: Frame, cache: bool) -> Shot:
    """Render in a process of its own. cache: use the result of an equal earlier call (Cycles only)."""
    key = f"{file.stem}-{engine.lower()}-{samples}-seed{seed}-{frame.name()}"
    picture, record = OUT / "renders" / f"{key}.exr", OUT / "renders" / f"{key}.json"
    if not (cache and picture.exists() and record.exists()):
        picture.parent.mkdir(parents=True, exist_ok=True)
        job = {
            "file": str(file), "engine": engine, "samples": samples, "seed": seed,
            "width": frame.width, "height": frame.height, "window": frame.window, "output": str(picture),
        }  # fmt: skip
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), str(ROOT / "native")]))
        command = [sys.executable, str(Path(__file__).with_name("_render_job.py")), json.dumps(job)]
        result = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        answers = [line[7:] for line in result.stdout.splitlines() if line.startswith("RESULT ")]
        if result.returncode != 0 or not answers:
            raise RuntimeError(f"{key}: no picture\n{(result.stdout + result.stderr)[-3000:]}")
        record.write_text(answers[-1])
    numbers = json.loads(record.read_text())
    combined = pictures.read_passes(picture)["Combined"]
    return Shot(
        samples, numbers["wall_s"], numbers["cpu_s"], numbers["peak_mib"], combined[..., :3], numbers.get("luch", {})
    )


def window_of(width: int, height: int, part: float) -> tuple[int, int, int, int]:
    """The central part of a frame: x0, y0, x1, y1 in pixels from the bottom left."""
    w, h = max(8, round(width * part)), max(8, round(height * part))
    return ((width - w) // 2, (height - h) // 2, (width - w) // 2 + w, (height - h) // 2 + h)


def race(folder: Path, name: str, options: argparse.Namespace) -> Row:
    """Everything about one scene."""
    file = folder / f"{name}.blend"
    full = pictures.read_passes(folder / "reference" / f"{name}.exr")["Combined"][..., :3]
    frame = Frame(full.shape[1], full.shape[0], window_of(full.shape[1], full.shape[0], options.part))
    x0, y0, x1, y1 = frame.window
    reference = full[frame.height - y1 : frame.height - y0, x0:x1]
    cycles = [shoot(file, "CYCLES", CYCLES_SAMPLES, seed, frame, not options.fresh) for seed in (1, 2)]
    cycles_error = float(np.mean([pictures.rel_mse(shot.picture, reference) for shot in cycles]))
    reference_noise = pictures.bias_rel_mse(cycles[0].picture, cycles[1].picture, reference)

    pilot = shoot(file, options.engine, PILOT_SAMPLES, 3, frame, False) if options.samples is None else None
    samples = options.samples or _samples_for(pilot, cycles_error, reference)
    halves = [shoot(file, options.engine, samples, seed, frame, False) for seed in (4, 5)]
    error = float(np.mean([pictures.rel_mse(shot.picture, reference) for shot in halves]))
    mean = (halves[0].picture + halves[1].picture) / 2
    bias = pictures.bias_rel_mse(halves[0].picture, halves[1].picture, reference) - reference_noise
    pictures.write_png(OUT / f"{name}.png", comparison(mean, reference))

    wall, cpu = (float(np.mean([getattr(shot, key) for shot in halves])) for key in ("wall_s", "cpu_s"))
    cycles_wall, cycles_cpu = (float(np.mean([getattr(shot, key) for shot in cycles])) for key in ("wall_s", "cpu_s"))
    # Error falls as 1 / samples: what is missing of (or beyond) Cycles' error is scaled by that law.
    factor = error / cycles_error
    wall_to_error = _time_at(factor, wall, samples, pilot.wall_s if pilot else None)
    cpu_to_error = _time_at(factor, cpu, samples, pilot.cpu_s if pilot else None)
    return Row(
        scene=name, width=x1 - x0, height=y1 - y0, cycles_wall_s=cycles_wall, cycles_cpu_s=cycles_cpu,
        cycles_error=cycles_error, samples=samples, wall_s=wall, cpu_s=cpu, error=error,
        wall_to_error_s=wall_to_error, cpu_to_error_s=cpu_to_error,
        time_ratio=wall_to_error / cycles_wall, cpu_ratio=cpu_to_error / cycles_cpu,
        bias=bias, bias_uncertainty=math.hypot(_bias_uncertainty(halves, reference), _bias_uncertainty(cycles, reference)), reference_noise=reference_noise,
        energy=[float(value) for value in pictures.energy_ratio(mean, reference)],
        cycles_energy=[float(value) for value in pictures.energy_ratio(
            (cycles[0].picture + cycles[1].picture) / 2, reference)],
        peak_mib=halves[0].peak_mib, cycles_peak_mib=cycles[0].peak_mib,
        warnings=[str(text) for text in halves[0].statistics.get("warnings", [])],
    )  # fmt: skip


def _samples_for(pilot: Shot | None, target: float, reference: F32) -> int:
    """Samples that reach the target error, from the pilot's error and the 1/n law; 4 to 1,024."""
    assert pilot is not None
    wanted = pilot.samples * pictures.rel_mse(pilot.picture, reference) / target
    return min(1024, max(4, round(wanted)))


def _time_at(factor: float, seconds: float, samples: int, pilot_seconds: float | None) -> float:
    """Seconds for samples * factor, the fixed cost (from the pilot, where there is one) not scaled."""
    if pilot_seconds is None or samples == PILOT_SAMPLES:
        return seconds * factor
    per_sample = max(0.0, (seconds - pilot_seconds) / (samples - PILOT_SAMPLES))
    return max(0.0, seconds + per_sample * samples * (factor - 1))


def _bias_uncertainty(halves: list[Shot], reference: F32) -> float:
    """Standard error of the bias from blocks of 8 x 8 pixels (neighbours share filter and texture)."""
    r = reference.astype(np.float64)
    a, b = (shot.picture.astype(np.float64) - r for shot in halves)
    product = (a * b / (np.abs(r) + 0.01) ** 2).mean(axis=2)
    height, width = (extent // 8 * 8 for extent in product.shape)
    blocks = product[:height, :width].reshape(height // 8, 8, width // 8, 8).mean(axis=(1, 3))
    return float(blocks.std() / math.sqrt(blocks.size))


def comparison(picture: F32, reference: F32) -> NDArray[np.uint8]:
    """Side by side, exposed alike so that dark scenes can be judged."""
    luminance = reference.mean(axis=2)
    exposure = float(np.clip(0.4 / max(float(np.median(luminance)), 1e-6), 0.25, 8.0))
    return pictures.side_by_side(picture * np.float32(exposure), reference * np.float32(exposure))


def print_table(rows: list[Row]) -> None:
    print(
        f"\n{'scene':<24}{'size':>9} {'Cycles s':>9} {'error':>8} | {'spp':>5} {'s':>7} {'error':>8} "
        f"{'to err s':>8} {'ratio':>6} {'cpu':>6} | {'bias':>9} {'+-':>8} {'ref noise':>9} | energy R G B            | verdict"
    )
    for row in rows:
        energy = " ".join(f"{value:.4f}" for value in row.energy)
        print(
            f"{row.scene:<24}{row.width:>4}x{row.height:<4} {row.cycles_wall_s:>9.1f} {row.cycles_error:>8.4f} | "
            f"{row.samples:>5} {row.wall_s:>7.1f} {row.error:>8.4f} {row.wall_to_error_s:>8.1f} {row.time_ratio:>6.2f} "
            f"{row.cpu_ratio:>6.2f} | {row.bias:>9.1e} {row.bias_uncertainty:>8.0e} {row.reference_noise:>9.1e} | "
            f"{energy} | {row.verdict()}"
        )
    if rows:
        means = (
            math.exp(sum(math.log(max(getattr(row, key), 1e-9)) for row in rows) / len(rows))
            for key in ("time_ratio", "cpu_ratio")
        )
        print("geometric mean of the time ratios: {:.2f} (wall), {:.2f} (CPU); bar 1.5, goal 0.5".format(*means))


def main() -> int:
    parser = argparse.ArgumentParser(prog="build.py bench scenes", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--scene", nargs="+", default=SCENES, metavar="NAME", help=f"default: {' '.join(SCENES)}")
    parser.add_argument("--samples", type=int, help="samples of each half (default: what reaches Cycles' error)")
    parser.add_argument("--part", type=float, default=1.0, help="only this central part of the frame, for a quick look")
    parser.add_argument("--fresh", action="store_true", help="render Cycles again instead of using out/bench/renders")
    parser.add_argument("--engine", default="LUCH", choices=["LUCH", "CYCLES"], help="CYCLES checks the bench itself")
    options = parser.parse_args()
    folder = scenes_folder()
    if folder is None:
        print("no scenes: no shared/scenes beside the checkout and LUCH_SCENES is not set; nothing was measured")
        return 2
    rows, failures = [], []
    for name in options.scene:
        print(f"{name} ...", flush=True)
        try:
            rows.append(race(folder, name, options))
            print_table(rows[-1:])
        except (RuntimeError, OSError, KeyError) as error:
            failures.append(name)
            print(f"{name}: {error}")
    print_table(rows)
    OUT.mkdir(parents=True, exist_ok=True)
    report = {"processors": os.cpu_count(), "engine": options.engine, "rows": [asdict(row) for row in rows]}
    (OUT / "scenes.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"pictures and scenes.json in {OUT}" + (f"; failed: {', '.join(failures)}" if failures else ""))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

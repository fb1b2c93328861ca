"""What an effect costs that the scene lacks, and what one saves that the user leaves out: time, bytes, code.

  build.py bench economy [SCENE.luch ...] [--device CUDA] [--samples 16] [--rounds 9] [--only NAME ...] [--docs]

Default scene: the repository's demo. Renders of one process in turns (lean, other, lean, other, ...), so that a slow
moment hits both; the ratio of each pair's seconds, its median and a 95 % interval from the order of the pairs (the
binomial one of the median).

  idle     effects that the scene lacks, simulated all the same (Settings.force_effects): 1.00 is the goal, no bit of
           the picture may differ
  left out effects that the scene has, left out (Settings.without_effects): what they cost, and how much of the picture
           they are (relMSE against the whole, noise included)

On CUDA the kernels' code is told, too: registers and local bytes of shade_surfaces, bytes of all stages. Every row is
kept in tests/bench/records/economy-DEVICE.json; --docs writes the tables of docs/effects.md from both devices' records.
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests"), str(ROOT / "tests" / "bench")]

import economy_page  # noqa: E402
import numpy as np  # noqa: E402
from luch.effects import effects_of  # noqa: E402
from luch.effects.forcing import ALL, forcible  # noqa: E402
from luch.effects.removal import REMOVALS  # noqa: E402
from luch.render import Result, render  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.scenefile import read_scene  # noqa: E402
from support.checkout import commit  # noqa: E402

OUT = ROOT / "out" / "bench"
BYTES = ("film_pixel_bytes", "scene_bytes", "structure_bytes", "device_scene_bytes", "device_film_and_paths_bytes")


def demo() -> Path:
    """The demo scene as a file."""
    path = OUT / "demo.luch"
    if not path.exists():
        import bpy
        from luch.scenefile import write_scene
        from scenes import demo as script

        from addon.engine import capture_scene
        from buildtools.inside import session

        script.build()
        scene = session.open_file(None)
        session.choose_size(scene, 480, 270)
        write_scene(capture_scene(scene, bpy.context.view_layer), path)
    return path


def code_of(result: Result) -> dict[str, float]:
    """Of the kernel that shades, where a GPU ran it."""
    return dict(result.stats.get("shading_kernel", {}))


def interval(ratios: list[float]) -> tuple[float, float, float]:
    """Median and the ranks that hold it with at least 95 % (binomial, each pair one throw)."""
    ordered, count = sorted(ratios), len(ratios)
    below, chance, term = 0, 0.0, 0.5**count
    while chance + term <= 0.025 and below < count // 2:
        chance += term
        term *= (count - below) / (below + 1)
        below += 1
    low = max(0, below - 1)
    return float(np.median(ordered)), ordered[low], ordered[count - 1 - low]


def compare(lean: Scene, other: Scene, rounds: int) -> dict[str, Any]:
    """Seconds of `other` over those of `lean`, pair by pair, and what else differs."""
    first, second = render(lean), render(other)  # warm up: compiled, cached
    ratios = []
    for turn in range(rounds):
        pair = [lean, other] if turn % 2 else [other, lean]
        took = [render(scene).stats["render_seconds"] for scene in pair]
        ratios.append(took[1] / took[0] if turn % 2 else took[0] / took[1])
    median, low, high = interval(ratios)
    a, b = (result.passes["Combined"][..., :3].astype(np.float64) for result in (first, second))
    return {
        "ratio": median, "low": low, "high": high, "same_bits": bool(np.array_equal(a, b)),
        "difference": float(np.mean((a - b) ** 2 / (np.abs(a) + 0.01) ** 2)),
        "bytes": {name: second.stats[name] - first.stats[name] for name in BYTES
                  if name in first.stats and second.stats[name] != first.stats[name]},
        "code": [code_of(first), code_of(second)],
    }  # fmt: skip


def asking(scene: Scene, **settings: Any) -> Scene:
    """The scene with other settings."""
    return replace(scene, settings=replace(scene.settings, **settings))


def keep(device: str, scene: str, kind: str, name: str, row: dict[str, Any]) -> None:
    """Puts a row into the device's record, in place of the last of its name."""
    file = economy_page.record_of(device)
    record = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    where = {"date": datetime.date.today().isoformat(), "commit": commit()}
    record.setdefault(scene, {}).setdefault(kind, {})[name] = row | where
    file.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def race(path: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One scene's tables."""
    scene = asking(read_scene(path), samples=options.samples, time_limit=0.0, device=options.device)
    effects = effects_of(scene)
    idle = [name for name in forcible() if name in effects and not effects[name].on and not name.startswith("pass ")]
    present = [name for name in REMOVALS if name in effects and effects[name].on]
    wanted = set(options.only or [*idle, *present, ALL])
    rows: dict[str, Any] = {"scene": path.stem, "device": options.device, "idle": {}, "left out": {}}
    for kind, names in (("idle", [*idle, ALL]), ("left out", present)):
        for name in (name for name in names if name in wanted):
            other = asking(scene, **{"force_effects" if kind == "idle" else "without_effects": [name]})
            rows[kind][name] = row = compare(scene, other, options.rounds)
            told = f"{row['ratio']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
            picture = "same bits" if row["same_bits"] else f"relMSE {row['difference']:.2g}"
            more = "".join(f", {field} {change:+,}" for field, change in row["bytes"].items())
            code = "".join(
                f", {field} {row['code'][0][field]:g} -> {value:g}" for field, value in row["code"][1].items()
            )
            keep(options.device, path.stem, kind, name, row)
            print(f"{path.stem:20} {kind:9} {name:24} {told}  {picture}{more}{code}", flush=True)
    return rows


def main() -> int:
    """1 where an idle effect changed a bit."""
    parser = argparse.ArgumentParser(prog="build.py bench economy", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("scenes", type=Path, nargs="*")
    parser.add_argument("--device", default="CPU", type=str.upper, choices=["CPU", "CUDA"])
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    parser.add_argument("--docs", action="store_true", help="write docs/effects.md from the records, measure nothing")
    options = parser.parse_args()
    if options.docs:
        economy_page.write()
        return 0
    OUT.mkdir(parents=True, exist_ok=True)
    tables = [race(path, options) for path in options.scenes or [demo()]]
    return int(any(not row["same_bits"] for table in tables for row in table["idle"].values()))


if __name__ == "__main__":
    sys.exit(main())

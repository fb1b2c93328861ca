"""Luch on CUDA against Cycles on CUDA and OptiX: the time to Cycles' error at 1,024 samples, on real scenes.

A GPU machine may have no network and no shared scenes, so the race has three parts:

  build.py bench device_scenes pack FOLDER     here: .blend and .luch of each scene, sized as their references
  python device_scenes.py luch FOLDER OUT [--general]      there: needs CuPy and Luch
  python3.13 device_scenes.py cycles FOLDER OUT CUDA|OPTIX     there: needs bpy
  build.py bench device_scenes judge OUT       here: errors against the references, the table, the record

Seconds are of 1,024 samples at four times the reference's pixels (about 518,400), less those of one sample: no start,
no compiling, no export. Errors are of pictures of the reference's own size. The ratio of a scene is Luch's seconds
times its error over Cycles' seconds times its error, as errors fall as one over the samples; bias is the cross product
of two seeds' differences from the reference. --general times the kernels that `build.py build --cuda` compiled for any
scene beside the scene's own. Scenes that no peer rendered stand in the table without a ratio.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

SCENES = ["cornell_box", "veach_mis", "modern_hall", "volumetric_caustic", "white_room", "little_lamp"]
SAMPLES = 1024
GENERAL_SAMPLES = 128
SIDES = 2  # of the timed frame over the reference's
SEED = 11


def pack(options: argparse.Namespace) -> int:
    """Copies .blend files and exports .luch files of the references' sizes."""
    import shutil
    import subprocess

    from scenes import scenes_folder
    from support import pictures

    folder = scenes_folder()
    if folder is None:
        print("no scenes: no shared/scenes beside the checkout and LUCH_SCENES is not set")
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    sizes = {}
    for name in options.scene:
        height, width = pictures.read_passes(folder / "reference" / f"{name}.exr")["Combined"].shape[:2]
        sizes[name] = [width, height]
        shutil.copyfile(folder / f"{name}.blend", options.folder / f"{name}.blend")
        subprocess.run(
            [sys.executable, __file__, "export", str(options.folder), name, str(width), str(height)], check=True
        )
    (options.folder / "sizes.json").write_text(json.dumps(sizes))
    return 0


def export(options: argparse.Namespace) -> int:
    """One scene to a .luch file, as its reference was made."""
    import bpy
    from luch.scenefile import write_scene

    from addon.engine import capture_scene
    from buildtools.inside import session

    scene = session.open_file(str(options.folder / f"{options.name}.blend"))
    session.choose_size(scene, options.width, options.height)
    session.choose_samples(scene, SAMPLES, 0.0, SEED)
    write_scene(capture_scene(scene, bpy.context.view_layer), options.folder / f"{options.name}.luch")
    return 0


def luch(options: argparse.Namespace) -> int:
    """Times every scene, keeps its picture, and says where the time goes."""
    from dataclasses import replace

    import numpy as np
    from device_render import StageTimes
    from luch.cuda import compiler, device
    from luch.render import render
    from luch.scenefile import read_scene
    from support.checkout import commit

    seconds, kept = {}, {}
    for name in options.scene:
        scene = read_scene(options.folder / f"{name}.luch")
        film = replace(scene.film, passes=["Combined"])
        large = replace(film, width=film.width * SIDES, height=film.height * SIDES)

        def run(samples: int, film: Any = large, scene: Any = scene, seed: int = SEED, own_kernels: bool = True) -> Any:
            settings = replace(scene.settings, samples=samples, device="CUDA", time_limit=0.0, seed=seed,
                               own_kernels=own_kernels)  # fmt: skip
            return render(replace(scene, film=film, settings=settings))

        first = run(1)  # compiles
        compiler.quiet()  # where general kernels began it
        one, many = run(1), run(SAMPLES)
        with StageTimes() as times:
            run(64)
        stages = times.milliseconds()
        for index in range(2):
            kept[f"{name}.{index}"] = run(SAMPLES, film, seed=SEED + index).passes["Combined"][::-1, :, :3]
        seconds[name] = {
            "general": _general_over_own(run) if options.general else None,
            "shading": many.stats.get("shading_kernel"),
            "seconds": many.stats["render_seconds"] - one.stats["render_seconds"],
            "fixed": one.stats["render_seconds"] + one.stats["prepare_seconds"],
            "compile": first.stats["kernel_compile_seconds"],
            "stages": {kernel: ms / sum(stages.values()) for kernel, ms in stages.items()},
            "warnings": many.stats["warnings"],
        }
        print(name, json.dumps(seconds[name]), flush=True)
        options.out.mkdir(parents=True, exist_ok=True)
        told = {"machine": device.describe(), "commit": commit(), "scenes": seconds}
        (options.out / "luch.json").write_text(json.dumps(told))
        np.savez_compressed(options.out / "luch.npz", **kept)
    return 0


def _general_over_own(run: Callable[..., Any]) -> float | None:
    """Seconds of the general kernels over those of the scene's own. None: no general ones, or a scene that needs more."""

    def seconds(own: bool) -> tuple[float, bool]:
        one, many = (run(samples, own_kernels=own).stats for samples in (1, GENERAL_SAMPLES))
        return many["render_seconds"] - one["render_seconds"], many["kernels"] == "general"

    own, (general, real) = seconds(True)[0], seconds(False)
    return general / own if real else None


def cycles(options: argparse.Namespace) -> int:
    """Times every scene in Cycles on the GPU, keeps its picture as EXR."""
    import bpy

    options.out.mkdir(parents=True, exist_ok=True)
    sizes, seconds = json.loads((options.folder / "sizes.json").read_text()), {}
    for name in options.scene:
        bpy.ops.wm.open_mainfile(filepath=str(options.folder / f"{name}.blend"), use_scripts=False)
        scene: Any = bpy.context.scene
        _choose_gpu(bpy, scene, options.device)

        def run(samples: int, sides: int, scene: Any = scene, size: list[int] = sizes[name]) -> float:
            scene.cycles.samples = samples
            scene.render.resolution_x, scene.render.resolution_y = size[0] * sides, size[1] * sides
            start = time.perf_counter()
            bpy.ops.render.render(scene=scene.name)
            return time.perf_counter() - start

        run(1, SIDES)
        one = run(1, SIDES)
        many = run(SAMPLES, SIDES)
        run(SAMPLES, 1)
        image = scene.render.image_settings
        image.media_type = "IMAGE"
        image.file_format, image.color_mode, image.color_depth, image.exr_codec = "OPEN_EXR", "RGB", "32", "ZIP"
        bpy.data.images["Render Result"].save_render(str(options.out / f"{name}-{options.device}.exr"), scene=scene)
        seconds[name] = {"seconds": many - one, "fixed": one}
        print(options.device, name, seconds[name], flush=True)
        (options.out / f"cycles-{options.device}.json").write_text(json.dumps(seconds))
    return 0


def _choose_gpu(bpy: Any, scene: Any, backend: str) -> None:
    preferences = bpy.context.preferences.addons["cycles"].preferences
    preferences.compute_device_type = backend
    preferences.get_devices()
    for found in preferences.devices:
        found.use = found.type == backend
    scene.render.engine = "CYCLES"
    scene.cycles.device = "GPU"
    scene.cycles.seed = SEED
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.time_limit = 0.0
    scene.render.use_persistent_data = scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.resolution_percentage = 100


def judge(options: argparse.Namespace) -> int:
    """The table and its geometric mean; writes tests/bench/records/scenes-cuda.json, or, where no peer rendered,
    scenes-cuda-luch.json."""
    import numpy as np
    from scenes import scenes_folder
    from support import pictures

    folder = scenes_folder()
    if folder is None:
        print("no scenes: no shared/scenes beside the checkout and LUCH_SCENES is not set")
        return 2
    ours = json.loads((options.out / "luch.json").read_text())
    peers = {
        path.stem.split("-")[1]: json.loads(path.read_text()) for path in sorted(options.out.glob("cycles-*.json"))
    }
    own, rows = np.load(options.out / "luch.npz"), []
    for name, told in ours["scenes"].items():
        reference = pictures.read_passes(folder / "reference" / f"{name}.exr")["Combined"][..., :3]
        first, second = (own[f"{name}.{index}"] for index in range(2))
        energy = pictures.energy_ratio((first + second) / 2, reference)
        row = {"scene": name, **told, "error": pictures.rel_mse(first, reference),
               "bias": pictures.bias_rel_mse(first, second, reference),
               "energy": [float(part) for part in energy]}  # fmt: skip
        raced = {backend: of for backend, of in peers.items() if name in of}
        for backend, of in raced.items():
            (picture,) = pictures.read_passes(options.out / f"{name}-{backend}.exr").values()
            error = pictures.rel_mse(picture, reference)
            row[backend] = {**of[name], "error": error,
                            "ratio": row["seconds"] * row["error"] / (of[name]["seconds"] * error)}  # fmt: skip
        row["ratio"] = max((row[backend]["ratio"] for backend in raced), default=None)  # of the better peer
        rows.append(row)
        dear = ", ".join(f"{kernel} {share:.0%}" for kernel, share in list(told["stages"].items())[:4])
        versus = "  ".join(f"{b} {row[b]['seconds']:.1f} s {row[b]['error']:.5f}" for b in raced)
        print(f"{name:22} {row['seconds']:6.2f} s {row['error']:.5f}  bias {row['bias']:.1e}  energy "
              f"{'  '.join(f'{part:.4f}' for part in energy)}  {versus}  ratio {row['ratio'] or math.nan:.2f}  ({dear})")  # fmt: skip
    ratios = [row["ratio"] for row in rows if row["ratio"]]
    record = {"machine": ours["machine"], "commit": ours["commit"], "samples": SAMPLES, "rows": rows}
    if ratios:
        mean = math.exp(sum(math.log(ratio) for ratio in ratios) / len(ratios))
        print(f"geometric mean of the ratios {mean:.2f}; bar 1.0, goal 0.5")
        record["geometric_mean"] = mean
    target = ROOT / "tests" / "bench" / "records" / f"scenes-cuda{'' if ratios else '-luch'}.json"
    target.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="build.py bench device_scenes", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parts = parser.add_subparsers(required=True, metavar="PART")
    for name, run, places in (("pack", pack, ("folder",)), ("luch", luch, ("folder", "out")),
                              ("cycles", cycles, ("folder", "out")), ("judge", judge, ("out",))):  # fmt: skip
        part = parts.add_parser(name, help=run.__doc__)
        for place in places:
            part.add_argument(place, type=Path)
        if name == "cycles":
            part.add_argument("device", choices=["CUDA", "OPTIX"])
        if name == "luch":
            part.add_argument("--general", action="store_true", help="time the general kernels too")
        if name != "judge":
            part.add_argument("--scene", nargs="+", default=SCENES, metavar="NAME")
        part.set_defaults(run=run)
    one = parts.add_parser("export", help=export.__doc__)
    one.add_argument("folder", type=Path)
    one.add_argument("name")
    one.add_argument("width", type=int)
    one.add_argument("height", type=int)
    one.set_defaults(run=export)
    options = parser.parse_args()
    status: int = options.run(options)
    return status


if __name__ == "__main__":
    sys.exit(main())

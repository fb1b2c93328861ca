"""Races bare rays: every structure of Luch, and Embree, over generated meshes.

  build.py bench rays [--rays 65536] [--meshes hall,...] [--contestants BVH,KD_TREE,...] [--docs]

One thread each, in one process, turn by turn. Seconds are the process's CPU time, the best of the rounds, so other
work on the machine matters little. Ray kinds: primary (Morton order), shadow (to a lamp), diffuse (one bounce,
cosine lobe), random (chords of the scene's box). Prints Mrays/s, the ratio to Embree, build time, bytes, the work of
a ray, and the rays whose hit or miss differs from Luch's wide tree (Embree's default test is not watertight).
A contestant that is slow on a mesh is measured on fewer rays. Brute force runs only where it is named.
--docs writes the tables and plots of docs/rays.md. Writes out/bench/rays.json in any case.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "native"), str(ROOT / "tests"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
from embree import EmbreeAccel  # noqa: E402
from luch import accel as structures  # noqa: E402
from luch.accel import Accel  # noqa: E402
from luch.bench.meshes import HARD_MESHES, MESHES, RayScene  # noqa: E402
from luch.bench.rays import KINDS, ray_sets  # noqa: E402

SLOW_RAYS = 1024  # a first taste, and all that a contestant gets that needs longer than SLOW_S for it
SLOW_S = 0.25
Row = dict[str, Any]


def contestants(options: argparse.Namespace) -> dict[str, tuple[str, str, str]]:
    """Name -> kind, precision, build quality."""
    names = options.contestants.split(",") if options.contestants else [
        *(kind for kind in structures.KINDS if kind != "BRUTE_FORCE"), "BVH FAST", "BVH DOUBLE", "BVH2 high", "BVH2 fast"
    ]  # fmt: skip
    chosen = {}
    for name in names:
        kind, _, rest = name.partition(" ")
        precision = rest if rest in structures.PRECISIONS else "WATERTIGHT"
        quality = rest.upper() if rest in ("high", "fast") else "NORMAL"
        chosen[name] = (kind, precision, quality)
    return chosen


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of the whole process."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def race(scene: RayScene, options: argparse.Namespace) -> list[Row]:
    """Builds and traces each contestant in turns; one row per contestant."""
    EmbreeAccel(scene.positions[:3], np.array([[0, 1, 2]], np.uint32), "default", 1)  # starts its device, untimed
    makers: dict[str, Callable[[], Any]] = {
        name: lambda k=kind, p=precision, q=quality: Accel(
            scene.positions, scene.triangles, kind=k, precision=p, quality=q, threads=1
        )
        for name, (kind, precision, quality) in contestants(options).items()
    }
    for quality in filter(None, options.embree.split(",")):
        makers[f"embree {quality}"] = lambda q=quality: EmbreeAccel(scene.positions, scene.triangles, q, 1)
    rows: list[Row] = []
    built: list[Any] = []
    for name, make in makers.items():
        build_s, accel = min((seconds(make) for _ in range(options.builds)), key=lambda pair: pair[0])
        built.append(accel)
        rows.append({"mesh": scene.name, "contestant": name, "triangles": len(scene.triangles),
                     "build_ms_per_mtri": build_s * 1e9 / len(scene.triangles),
                     "bytes_per_triangle": bytes_of(accel) / len(scene.triangles)})  # fmt: skip
    for kind, rays in ray_sets(scene, 1024, options.rays).items():
        trace_all(kind, rays, built, rows, options.rounds)
    return rows


def bytes_of(accel: Any) -> int:
    """The structure and what it needs of the primitives."""
    if isinstance(accel, EmbreeAccel):
        return accel.bytes
    return int(accel.stats["bytes"] + accel.stats.get("primitive_bytes", 0))


def trace_all(kind: str, rays: Any, built: list[Any], rows: list[Row], rounds: int) -> None:
    """One kind of rays through every contestant; fills its rate, its work a ray, and where it differs from the first."""
    hits: list[Any] = [None] * len(rows)
    step = max(1, len(rays) // SLOW_RAYS)
    taste = np.ascontiguousarray(rays[::step])
    lengths = [len(rays)] * len(rows)
    for i, accel in enumerate(built):
        work = accel.any if kind == "shadow" else accel.closest
        taste_s, _ = seconds(lambda w=work: w(taste))
        lengths[i] = len(taste) if taste_s > SLOW_S else len(rays)
    for turn in range(rounds):
        for i, accel in enumerate(built):
            if turn and lengths[i] < len(rays):
                continue
            some = rays if lengths[i] == len(rays) else taste
            work = accel.any if kind == "shadow" else accel.closest
            took, result = seconds(lambda w=work, r=some: w(r))
            rows[i][kind] = max(rows[i].get(kind, 0.0), len(some) / took / 1e6)
            hits[i] = result if kind == "shadow" else result[1] >= 0
    for i, (row, accel) in enumerate(zip(rows, built, strict=True)):
        first = hits[0] if len(hits[i]) == len(hits[0]) else hits[0][::step]
        row[f"{kind}_differ"] = int((hits[i] != first).sum())
        if isinstance(accel, Accel):
            counts = accel.count(taste, any_hit=kind == "shadow")
            row[f"{kind}_nodes"], row[f"{kind}_tests"] = (counts[k] / len(taste) for k in ("nodes", "primitives"))


def report(rows: list[Row]) -> None:
    """The table, then the geometric means of the first contestant's ratios to Embree."""
    print(f"{'mesh':10} {'contestant':18} " + " ".join(f"{k:>8}" for k in KINDS)
          + " | ms/Mtri   B/tri | diffuse ray: nodes, tests | differ")  # fmt: skip
    for row in rows:
        work = (f"{row['diffuse_nodes']:8.1f} {row['diffuse_tests']:8.1f}" if "diffuse_nodes" in row else " " * 17)  # fmt: skip
        print(f"{row['mesh']:10} {row['contestant']:18} " + " ".join(f"{row[k]:8.3f}" for k in KINDS)
              + f" | {row['build_ms_per_mtri']:7.0f} {row['bytes_per_triangle']:7.1f} | {work}          | "
              + " ".join(str(row[f"{k}_differ"]) for k in KINDS))  # fmt: skip
    for name, means in ratios(rows).items():
        print(name + ": " + "  ".join(f"{k} {v:.2f}" for k, v in means.items()))


def ratios(rows: list[Row]) -> dict[str, dict[str, float]]:
    """Geometric means over the race's meshes, the hard ones beside it left out where others are: the wide tree beside
    every other contestant."""
    rows = [row for row in rows if row["mesh"] in MESHES] or rows
    of = {(row["contestant"], row["mesh"]): row for row in rows}
    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    first = rows[0]["contestant"]
    found = {}
    for peer in list(dict.fromkeys(row["contestant"] for row in rows))[1:]:
        found[f"{first} / {peer}"] = {
            key: math.exp(sum(math.log(of[first, m][key] / of[peer, m][key]) for m in meshes) / len(meshes))
            for key in (*KINDS, "build_ms_per_mtri")
        }
    return found


def best_wall(work: Callable[[], Any], rounds: int) -> float:
    """Seconds by the clock, the least of some."""
    took = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return min(took)


def scaling(options: argparse.Namespace) -> None:
    """Two threads against one, the eight-wide tree and Embree's default: by the clock, on a machine that is idle."""
    print(
        f"{'mesh':10} "
        + " ".join(f"{k:>8}" for k in KINDS)
        + "   build   (two threads over one; build beside Embree's)"
    )
    for name in options.meshes.split(","):
        scene = (MESHES | HARD_MESHES)[name]()
        mesh = scene.positions, scene.triangles
        trees = [Accel(*mesh, kind="BVH", threads=count) for count in (1, 2)]
        ratios = []
        for kind, rays in ray_sets(scene, 1024, options.rays).items():
            one, two = (best_wall(partial(tree.any if kind == "shadow" else tree.closest, rays), 5) for tree in trees)
            ratios.append(one / two)
        builds = [best_wall(lambda n=count, m=mesh: Accel(*m, kind="BVH", threads=n), 3) for count in (1, 2)]
        peer = best_wall(lambda m=mesh: EmbreeAccel(*m, "default", 2), 3)
        print(f"{name:10} " + " ".join(f"{ratio:8.2f}" for ratio in ratios)
              + f"{builds[0] / builds[1]:8.2f}   {builds[1] / peer:.2f} of Embree's time")  # fmt: skip


def main() -> None:
    """Parses the command line, races, writes out/bench/rays.json."""
    parser = argparse.ArgumentParser(prog="build.py bench rays", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--rays", type=int, default=65536, help="rays of each kind (default 65536)")
    parser.add_argument("--meshes", default=",".join(MESHES | HARD_MESHES))
    parser.add_argument(
        "--contestants", help="kind, or kind with a precision or a build quality: BVH,BVH FAST,BVH2 high"
    )
    parser.add_argument("--embree", default="default,robust", help="its qualities: default, robust, high")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--builds", type=int, default=1)
    parser.add_argument("--docs", action="store_true", help="write the tables and plots of docs/rays.md")
    parser.add_argument("--scaling", action="store_true", help="two threads against one instead of the race")
    options = parser.parse_args()
    if options.scaling:
        scaling(options)
        return
    rows: list[Row] = []
    for name in options.meshes.split(","):
        rows += race((MESHES | HARD_MESHES)[name](), options)
        print(f"{name} done", flush=True)
    report(rows)
    out = ROOT / "out" / "bench" / "rays.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(rows, indent=1))
    if options.docs:
        from rays_page import write_cuda_part, write_page

        write_page(rows, ratios(rows))
        write_cuda_part()


if __name__ == "__main__":
    main()

"""Races bare rays against Embree: python tests/bench/rays.py [--size 256] [--meshes hall,...] [--qualities default,...]

One thread each, in one process, turn by turn. Seconds are the process's CPU time, the best of the rounds, so other
work on the machine matters little. Ray kinds: primary (Morton order), shadow (to a lamp), diffuse (one bounce,
cosine lobe), random (chords of the scene's box). Prints Mrays/s, the ratio to Embree, build time and bytes, and the
rays whose hit or miss differs from Embree's (its default test is not watertight; compare with robust).
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
sys.path[:0] = [str(ROOT / "native"), str(ROOT / "tests"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
from embree import EmbreeAccel  # noqa: E402
from luch.accel import Accel  # noqa: E402
from luch.bench.meshes import MESHES, RayScene  # noqa: E402
from luch.bench.rays import KINDS, ray_sets  # noqa: E402


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of the whole process."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def race(scene: RayScene, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Builds and traces each contestant in turns; one row per contestant."""
    EmbreeAccel(scene.positions[:3], np.array([[0, 1, 2]], np.uint32), "default", 1)  # starts its device, untimed
    rows: list[dict[str, Any]] = []
    built: list[Any] = []
    makers: dict[str, Callable[[], Any]] = {"luch": lambda: Accel(scene.positions, scene.triangles, threads=1)}
    for quality in options.qualities.split(","):
        makers[f"embree {quality}"] = lambda q=quality: EmbreeAccel(scene.positions, scene.triangles, q, 1)
    for name, make in makers.items():
        build_s, accel = min((seconds(make) for _ in range(options.builds)), key=lambda pair: pair[0])
        size = accel.stats["bytes"] if name == "luch" else accel.bytes
        built.append(accel)
        rows.append({"mesh": scene.name, "contestant": name, "triangles": len(scene.triangles),
                     "build_ms_per_mtri": build_s * 1e9 / len(scene.triangles),
                     "bytes_per_triangle": size / len(scene.triangles)})  # fmt: skip
    sets = ray_sets(scene, 1024, options.size**2)
    for kind, rays in sets.items():
        results: list[Any] = [None] * len(rows)
        for _ in range(options.rounds):
            for i, accel in enumerate(built):
                work = accel.any if kind == "shadow" else accel.closest
                took, results[i] = seconds(lambda w=work, r=rays: w(r))
                rows[i][kind] = max(rows[i].get(kind, 0.0), len(rays) / took / 1e6)
        hits = [r if kind == "shadow" else r[1] >= 0 for r in results]
        for i, row in enumerate(rows):
            row[f"{kind}_differ"] = int((hits[i] != hits[0]).sum())
    return rows


def report(rows: list[dict[str, Any]]) -> None:
    """The table, then the geometric mean of luch's ratios."""
    print(
        f"{'mesh':10} {'contestant':15} " + " ".join(f"{k:>8}" for k in KINDS) + " | ms/Mtri   B/tri | differ from luch"
    )
    for row in rows:
        print(f"{row['mesh']:10} {row['contestant']:15} " + " ".join(f"{row[k]:8.2f}" for k in KINDS)
              + f" | {row['build_ms_per_mtri']:7.0f} {row['bytes_per_triangle']:7.1f} | "
              + " ".join(str(row[f"{k}_differ"]) for k in KINDS))  # fmt: skip
    ours = {row["mesh"]: row for row in rows if row["contestant"] == "luch"}
    for peer in dict.fromkeys(row["contestant"] for row in rows if row["contestant"] != "luch"):
        theirs = {row["mesh"]: row for row in rows if row["contestant"] == peer}
        means = {}
        for key in (*KINDS, "build_ms_per_mtri"):
            ratios = [ours[m][key] / theirs[m][key] for m in ours]
            means[key] = math.exp(sum(map(math.log, ratios)) / len(ratios))
        print(f"luch / {peer:15}    " + "  ".join(f"{k} {v:.2f}" for k, v in means.items()))


def main() -> None:
    """Parses the command line, races, writes out/bench/rays.json."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--size", type=int, default=256, help="size * size rays of each kind (default 256)")
    parser.add_argument("--meshes", default=",".join(MESHES))
    parser.add_argument("--qualities", default="default", help="Embree's: default, robust, high")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--builds", type=int, default=1)
    options = parser.parse_args()
    rows = []
    for name in options.meshes.split(","):
        rows += race(MESHES[name](), options)
    report(rows)
    out = ROOT / "out" / "bench" / "rays.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()

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
import numpy.typing as npt  # noqa: E402
from embree import EmbreeAccel  # noqa: E402
from luch.accel import Accel  # noqa: E402
from ray_meshes import MESHES, RayScene  # noqa: E402

F32 = npt.NDArray[np.float32]
KINDS = ("primary", "shadow", "diffuse", "random")
BLOCKS = 16  # a large picture's rays are sampled as this many runs of neighbours


def morton_pixels(size: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """x and y of size * size pixels (a power of two) in Morton order."""
    code = np.arange(size * size, dtype=np.int64)
    x, y = np.zeros_like(code), np.zeros_like(code)
    for bit in range(size.bit_length() - 1):
        x |= (code >> 2 * bit & 1) << bit
        y |= (code >> (2 * bit + 1) & 1) << bit
    return x, y


def as_rays(origin: npt.NDArray[Any], direction: npt.NDArray[Any], t_max: float = math.inf) -> F32:
    """Rows ox oy oz tmin dx dy dz tmax; nothing nearer than 1e-4 of the ray counts, for both contestants."""
    rays = np.zeros((len(direction), 8), np.float32)
    rays[:, 0:3], rays[:, 4:7], rays[:, 7] = origin, direction, t_max
    return rays


def unit(v: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows of length 1."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def primary_rays(scene: RayScene, size: int, keep: int) -> F32:
    """Camera rays of a 1024 x 1024 picture, `keep` of them as runs of neighbours in Morton order."""
    eye = np.array(scene.eye)
    ahead = unit(np.array(scene.target) - eye)
    right = unit(np.cross(ahead, [0, 0, 1.0]))
    up = np.cross(right, ahead)
    x, y = morton_pixels(size)
    run = keep // BLOCKS
    chosen = (np.arange(BLOCKS)[:, None] * (size * size // BLOCKS) + np.arange(run)).ravel()
    a = ((x[chosen, None] + 0.5) / size * 2 - 1) * scene.fov_tangent
    b = ((y[chosen, None] + 0.5) / size * 2 - 1) * scene.fov_tangent
    return as_rays(eye, unit(ahead + a * right + b * up))


def ray_sets(scene: RayScene, size: int, keep: int) -> dict[str, F32]:
    """The four kinds of rays."""
    rng = np.random.default_rng(1)
    rays = {"primary": primary_rays(scene, size, keep)}
    t, prim, _, _ = Accel(scene.positions, scene.triangles).closest(rays["primary"])
    hit = prim >= 0
    first = rays["primary"][hit].astype(np.float64)
    corners = scene.positions[scene.triangles[prim[hit]]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    normal *= -np.sign((normal * first[:, 4:7]).sum(1, keepdims=True))
    point = first[:, :3] + first[:, 4:7] * t[hit, None]
    point += normal * 1e-4 * t[hit, None]
    rays["shadow"] = as_rays(point, np.array(scene.light) - point, 1.0)
    ball = unit(rng.normal(size=point.shape)) * 0.9999
    rays["diffuse"] = as_rays(point, unit(normal + ball))
    low, high = scene.positions.min(0), scene.positions.max(0)
    a, b = rng.uniform(low, high, (2, keep, 3))
    rays["random"] = as_rays(a, unit(b - a))
    return rays


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

"""The lecture's ladder on a GPU: every structure, mesh and kind of ray, with what each costs."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np

from luch.accel import Accel
from luch.bench.meshes import MESHES, RayScene
from luch.bench.rays import KINDS, ray_sets
from luch.cuda.compiler import table
from luch.cuda.device import cupy, describe, kernel_seconds
from luch.cuda.structures import BLOCK

BRUTE_RAYS = 1 << 17  # every primitive in turn: few rays, and one mesh
BRUTE_MESH = "arcade"
MAPPINGS = {"closest": 100, "closest_tiled": 130, "closest_reduced": "40-50"}  # the lecture's per cent
OTHERS = {  # further kernels of a structure
    "BVH2_STACKLESS": {"together": "closest_together"},
    "CWBVH": {"simple": "closest_simple"},
    "KD_TREE": {"full stack": "closest_full"},
}
SLOWEST = 0.3  # s a launch; a structure that takes longer traces a part of the rays


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `python -m luch bench rays`."""
    parser.add_argument("--device", choices=["cuda"], default="cuda")
    parser.add_argument("--meshes", default="arcade,hall,icosphere,teapot", help=f"of {', '.join(MESHES)}")
    parser.add_argument("--kinds", help="structures, with commas between (default: all)")
    parser.add_argument("--precisions", default="WATERTIGHT", help="FAST, WATERTIGHT, DOUBLE")
    parser.add_argument("--rays", type=int, default=1 << 21, help="rays a launch (default 2 Mi)")
    parser.add_argument("--quality", default="NORMAL", help="of the build: FAST, NORMAL, HIGH")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("bench-rays-cuda.json"))


def run(options: argparse.Namespace) -> int:
    """Prints the ladder and writes it as JSON. Returns 1 if any hit differs from the CPU's."""
    record: dict[str, Any] = {
        "date": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime()), "commit": commit(), "machine": describe(),
        "rays": options.rays, "quality": options.quality, "rows": [], "mappings": [],
    }  # fmt: skip
    print(json.dumps(record["machine"]))
    print(_heading())
    differ, kinds = 0, (options.kinds or ",".join(table()["modules"])).split(",")
    for mesh in options.meshes.split(","):
        scene = MESHES[mesh]()
        sets = ray_sets(scene, 2048, options.rays, fill=True)
        truth = expected(scene, sets)
        for kind in kinds:
            if kind == "BRUTE_FORCE" and mesh != BRUTE_MESH:
                continue
            for quality in (options.quality, *(["FAST"] if kind == "CWBVH" else [])):
                for row in rows_of(scene, kind, quality, sets, truth, options):
                    record["rows"].append(row)
                    differ += row["differ"]
                    print(_line(row), flush=True)
        if mesh == BRUTE_MESH and "BRUTE_FORCE" in kinds:
            record["mappings"] = mappings(scene, sets["primary"][:BRUTE_RAYS], options)
        options.output.write_text(json.dumps(record, indent=1), encoding="utf-8")
    print(f"{differ} results differ from the CPU's; {options.output}")
    return 1 if differ else 0


def expected(scene: RayScene, sets: dict[str, Any]) -> dict[str, Any]:
    """What the CPU's watertight tree says: it equals brute force bit for bit, as its own tests show."""
    accel = Accel(scene.positions, scene.triangles)
    return {kind: (accel.any(rays) if kind == "shadow" else accel.closest(rays)) for kind, rays in sets.items()}


def rows_of(
    scene: RayScene, kind: str, quality: str, sets: dict[str, Any], truth: dict[str, Any], options: argparse.Namespace
) -> list[dict[str, Any]]:
    """One row per precision and kind of ray, of one structure over one mesh."""
    made: dict[str, Any] = {"kind": kind, "quality": quality, "device": "CUDA"}
    if quality == "FAST":
        Accel(scene.positions, scene.triangles, **made)  # compiles the builder's kernels, untimed
    began = time.perf_counter()
    accel = Accel(scene.positions, scene.triangles, **made)
    build_s = time.perf_counter() - began
    million = len(scene.triangles) / 1e6
    name = kind + " gpu-built" * bool(accel.stats["built_on_device"])
    shared = {"mesh": scene.name, "triangles": len(scene.triangles), "structure": name,
              "build_ms_per_mtri": 1e3 * accel.stats.get("build_seconds", build_s) / million,
              "bytes_per_triangle": (accel.stats["bytes"] + accel.device_source_bytes) / len(scene.triangles)}  # fmt: skip
    rows = []
    for precision in options.precisions.split(","):
        for ray_kind in KINDS:
            rays = sets[ray_kind][: BRUTE_RAYS if kind == "BRUTE_FORCE" else None]
            row = measure(accel, precision, "any" if ray_kind == "shadow" else "closest", rays, options.repeats)
            row["differ"] = differing(accel, precision, ray_kind, rays, truth[ray_kind])
            rows.append(shared | {"precision": precision, "rays": ray_kind} | row)
        for variant, kernel in OTHERS.get(name, {}).items():
            for ray_kind in KINDS:
                if ray_kind == "shadow":
                    continue
                row = measure(accel, precision, kernel, sets[ray_kind], options.repeats)
                row["differ"] = differing(accel, precision, ray_kind, sets[ray_kind], truth[ray_kind], kernel)
                named = {"structure": f"{kind} {variant}", "precision": precision, "rays": ray_kind}
                rows.append(shared | named | row)
    return rows


def measure(accel: Accel, precision: str, kernel: str, rays: Any, repeats: int) -> dict[str, Any]:
    """Mrays/s, work a ray and the kernel's resources."""
    device = accel.on_device
    there = cupy().asarray(rays)
    few = there[:: max(1, len(rays) >> 14)].copy()  # a slow structure is found out on 16 thousand rays
    guess = kernel_seconds(device.launcher(kernel, precision, few), 1) * len(rays) / max(len(few), 1)
    if guess > SLOWEST * 16:
        there = few
    seconds = kernel_seconds(device.launcher(kernel, precision, there), repeats)
    trace = device.any if kernel == "any" else device.closest
    counts = trace(few, precision, True)[-1]
    per_ray = {name: value / max(len(few), 1) for name, value in counts.items()}
    resources = device.kernel(kernel, precision).properties(BLOCK)
    return {
        "traced": len(there),
        "ms": seconds * 1e3,
        "mrays_per_s": len(there) / seconds / 1e6,
        **per_ray,
        **resources,
    }


def differing(accel: Accel, precision: str, ray_kind: str, rays: Any, truth: Any, kernel: str = "closest") -> int:
    """Rays whose result differs from the CPU's in any bit. FAST and DOUBLE have other roundings: none is expected."""
    if precision != "WATERTIGHT" or not len(rays):
        return 0
    part = rays[: 1 << 17]
    if ray_kind == "shadow":
        return int((accel.any(part) != truth[: len(part)]).sum())
    differ = np.zeros(len(part), bool)
    found = accel.on_device.closest(part, precision, False, kernel)[:4]
    for ours, theirs in zip(found, truth, strict=True):
        differ |= ours.view(np.uint32) != theirs[: len(part)].view(np.uint32)
    return int(differ.sum())


def mappings(scene: RayScene, rays: Any, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Brute force's three ways to map rays and triangles to threads, the first as 100 per cent."""
    accel = Accel(scene.positions, scene.triangles, kind="BRUTE_FORCE", device="CUDA")
    there, rows, first = cupy().asarray(rays), [], 0.0
    for name, lecture in MAPPINGS.items():
        seconds = kernel_seconds(accel.on_device.launcher(name, "WATERTIGHT", there), options.repeats)
        first = first or seconds
        tests = len(rays) * len(scene.triangles) / seconds / 1e9
        resources = accel.on_device.kernel(name, "WATERTIGHT").properties(BLOCK)
        rows.append({"mapping": name, "ms": seconds * 1e3, "gtests_per_s": tests, "per_cent": 100 * first / seconds,
                     "lecture_per_cent": lecture, **resources})  # fmt: skip
        print(f"brute force {name:16} {seconds * 1e3:8.2f} ms {tests:7.1f} Gtests/s {100 * first / seconds:4.0f} % "
              f"(the lecture: {lecture}) {resources['registers']} registers")  # fmt: skip
    return rows


def commit() -> str:
    """Of the source tree that this runs from; LUCH_COMMIT where there is no git."""
    given = os.environ.get("LUCH_COMMIT", "")
    here = Path(__file__).parent
    try:
        text = subprocess.run(["git", "rev-parse", "HEAD"], cwd=here, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return given or "unknown"
    return given or text.strip()


def _heading() -> str:
    return (f"{'mesh':10} {'structure':23} {'precision':10} {'rays':8} {'Mrays/s':>9} {'nodes':>7} {'boxes':>7} {'tests':>7} "
            f"{'regs':>4} {'local':>5} {'shared':>6} {'occ':>4} {'ms/Mtri':>8} {'B/tri':>6} differ")  # fmt: skip


def _line(row: dict[str, Any]) -> str:
    return (f"{row['mesh']:10} {row['structure']:23} {row['precision']:10} {row['rays']:8} {row['mrays_per_s']:9.2f} "
            f"{row['nodes']:7.1f} {row['boxes']:7.1f} {row['primitives']:7.1f} {row['registers']:4.0f} "
            f"{row['local_bytes']:5.0f} {row['shared_bytes']:6.0f} {row['occupancy']:4.2f} "
            f"{row['build_ms_per_mtri']:8.1f} {row['bytes_per_triangle']:6.1f} {row['differ']}")  # fmt: skip

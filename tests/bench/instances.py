"""Scenes of many instances: rays a second of the kernels that renders trace with, and whether their hits are the CPU's.

python tests/bench/instances.py --device cuda --output instances.json
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "native"), str(ROOT / "tests")]

from luch.cuda.device import cupy, describe, kernel_seconds  # noqa: E402
from luch.cuda.trace import BLOCK, SceneTracer  # noqa: E402
from support.accel_meshes import icosphere, rows, soup  # noqa: E402
from support.instances import ALL, NEVER, NO_KINDS, Scene, placed  # noqa: E402

COMPARED = 1 << 16  # rays whose hits are compared with the CPU's
SCENES = {  # instances, subdivisions of the sphere, triangles that may be copied
    "one group": (1, 8, 0),
    "some flattened": (500, 4, 2_000_000),
    "instances 500": (500, 4, 0),
    "instances 20k": (20_000, 5, 0),
    "dense 20k": (20_000, 5, 0),
}


def scene_of(name: str) -> Scene:
    """Spheres and clouds of triangles in a cube of edge 20; dense ones overlap tenfold."""
    count, detail, _ = SCENES[name]
    rng = np.random.default_rng(2)
    scene = Scene([icosphere(detail), soup(2000, 0.05)])
    size = 10.0 / count ** (1 / 3) * (2.0 if name.startswith("dense") else 0.7)
    scene.instances = [(int(i % 5 == 4), placed(rng, 10.0, size), ALL) for i in range(count)]
    return scene


def ray_sets(count: int) -> dict[str, Any]:
    """Primary rays of a camera, in tiles of 8 by 8 pixels, and rays from anywhere to anywhere."""
    rng = np.random.default_rng(3)
    side = int(count**0.5) // 8 * 8
    tiles = np.arange(side * side).reshape(side // 8, 8, side // 8, 8).transpose(0, 2, 1, 3).ravel()
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, side), np.linspace(-0.5, 0.5, side))
    aim = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3)[tiles]
    inside = rng.uniform(-10, 10, (side * side, 3))
    return {"primary": rows(np.array([0, 0, -22.0]), aim), "random": rows(inside, rng.normal(size=inside.shape))}


def rates(trees: Any, rays: Any, truth: Any, blocked: Any, options: argparse.Namespace) -> list[dict[str, Any]]:
    """One row a kernel."""
    if options.device == "cpu":
        began = time.perf_counter()
        trees.closest(rays, NO_KINDS)
        return [{"kernel": "two_level.h", "mrays_per_s": len(rays) / (time.perf_counter() - began) / 1e6}]
    began, image, depth = time.perf_counter(), trees.device_image(), trees.stats()["depth"]
    tracer = SceneTracer(*image, "CWBVH", "WATERTIGHT", trees.has_world_apart(), trees.left_groups(), depth)
    cupy().cuda.Device().synchronize()
    print(f"  uploaded in {time.perf_counter() - began:.3f} s, groups built there: {len(trees.left_groups())}")
    one, found = "_one" if trees.is_one_group() else "", []
    for name in (f"trace_closest{one}", f"trace_any{one}", "trace_closest_simple", "trace_any_simple"):
        kernel, part = tracer.kernel(name), rays[:COMPARED]
        seconds = kernel_seconds(tracer.launcher(kernel, rays)[1], options.repeats)
        if name.startswith("trace_any"):
            differ = int((tracer.any_of(part, kernel=name) != blocked).sum())
        else:
            hits = tracer.closest_of(part, kernel=name)
            pairs = zip(("t", "prim", "u", "v", "instance"), truth, strict=True)
            differ = int(
                np.any([np.ascontiguousarray(hits[n]).view(np.uint32) != t.view(np.uint32) for n, t in pairs], 0).sum()
            )
        found.append(
            {"kernel": name, "mrays_per_s": len(rays) / seconds / 1e6, "differ": differ, **kernel.properties(BLOCK)}
        )
    return found


def main() -> int:
    """Prints a line a kernel; 1 if any hit differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--rays", type=int, default=1 << 22)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=0, help="of the builder; 0: all")
    parser.add_argument("--leave-from", type=int, default=NEVER, help="triangles of a group that the GPU builds itself")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    record: dict[str, Any] = {"machine": describe() if options.device == "cuda" else {}, "rows": []}
    for name in options.scenes.split(","):
        scene, flatten = scene_of(name), SCENES[name][2]
        trees, accel = (
            scene.trees(flatten=flatten, threads=options.threads, leave_from=options.leave_from),
            scene.build(flatten=flatten),
        )
        stats = trees.stats()
        print(f"{name}: {stats['triangles']} triangles in {stats['groups']} groups, {stats['entries']} entries, "
              f"{stats['bytes'] / 1e6:.1f} MB, built in {stats['build_seconds']:.2f} s")  # fmt: skip
        for kind, rays in ray_sets(options.rays).items():
            truth, blocked = accel.closest(rays[:COMPARED], NO_KINDS), accel.any(rays[:COMPARED], NO_KINDS)
            for row in rates(trees, rays, truth, blocked, options):
                record["rows"].append({"scene": name, "rays": kind, **row})
                print("  " + " ".join(f"{k} {v:.1f}" if isinstance(v, float) else f"{v}" for k, v in row.items()), kind)
        if options.device == "cuda":
            cupy().get_default_memory_pool().free_all_blocks()
    if options.output:
        options.output.write_text(json.dumps(record, indent=1), encoding="utf-8")
    return int(any(row.get("differ") for row in record["rows"]))


if __name__ == "__main__":
    sys.exit(main())

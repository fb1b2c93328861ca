"""Variants of the wide tree's CUDA kernel side by side: python tests/bench/tune_cwbvh.py [--meshes arcade,hall]

Each sets what rays/cwbvh.cuh lets a tuning run set. Prints Mrays/s by kind of ray, registers, occupancy; the hits of
every variant must be those of the CPU's watertight tree.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "native")]

import numpy as np  # noqa: E402
from luch.accel import Accel  # noqa: E402
from luch.bench.device_rays import expected  # noqa: E402
from luch.bench.meshes import MESHES  # noqa: E402
from luch.bench.rays import KINDS, ray_sets  # noqa: E402
from luch.cuda import compiler  # noqa: E402
from luch.cuda.device import cupy, kernel_seconds  # noqa: E402
from luch.cuda.structures import BLOCK  # noqa: E402

# Each changes one thing of the first.
VARIANTS: dict[str, dict[str, int]] = {
    "as it is": {},
    "no going together": {"TOGETHER": 0},
    "4 blocks": {"BLOCKS": 4},
    "5 blocks": {"BLOCKS": 5},
    "7 blocks": {"BLOCKS": 7},
    "8 blocks": {"BLOCKS": 8},
    "no waiting leaves": {"LEAF_SHARE": 32},
    "leaves wait for a half": {"LEAF_SHARE": 2},
    "leaves wait for an eighth": {"LEAF_SHARE": 8},
    "no new rays before all end": {"LOST_STEPS": 1 << 30},
    "new rays late": {"LOST_STEPS": 64},
    "new rays at once": {"LOST_STEPS": 4, "SPARE_LANES": 2},
    "stack: 4 shared": {"SHARED_ENTRIES": 4},
    "stack: 12 shared": {"SHARED_ENTRIES": 12},
    "asides in few banks": {"ODD_ASIDES": 0},
}
PLAIN_FLAGS = compiler.flags


def set_variant(defines: dict[str, int]) -> None:
    """The next kernels are compiled with these."""
    compiler.flags = lambda precision: [*PLAIN_FLAGS(precision), *(f"-DLUCH_{k}={v}" for k, v in defines.items())]
    compiler.load.cache_clear()


def wrong(accel: Accel, kind: str, kernel: str, rays: Any, truth: Any) -> int:
    """Rays whose result is not the CPU's, to the bit."""
    device = accel.on_device
    if kind == "shadow":
        return int(((device.any(rays, "WATERTIGHT", False)[0] != 0) != truth).sum())
    ours = device.closest(rays, "WATERTIGHT", False, kernel)[:4]
    return int(sum((a.view(np.uint32) != b.view(np.uint32)).sum() for a, b in zip(ours, truth, strict=True)))


def main() -> int:
    """Races all variants on all meshes; 1 if a hit was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--meshes", default="arcade,hall,icosphere,teapot")
    parser.add_argument("--rays", type=int, default=1 << 21)
    parser.add_argument("--quality", default="NORMAL")
    parser.add_argument("--output", type=Path, default=Path("tune-cwbvh.json"))
    options = parser.parse_args()
    rates: dict[str, dict[str, list[float]]] = {}
    errors = 0
    for mesh in options.meshes.split(","):
        scene = MESHES[mesh]()
        sets = ray_sets(scene, 2048, options.rays, fill=True)
        truth = expected(scene, sets)
        accel = Accel(scene.positions, scene.triangles, kind="CWBVH", quality=options.quality, device="CUDA")
        there = {kind: cupy().asarray(rays) for kind, rays in sets.items()}
        for name, defines in [*VARIANTS.items(), ("one thread a ray", {})]:
            set_variant(defines)
            suffix = "_simple" if name == "one thread a ray" else ""
            row = rates.setdefault(name, {})
            for kind in KINDS:
                kernel = ("any" if kind == "shadow" else "closest") + suffix
                seconds = kernel_seconds(accel.on_device.launcher(kernel, "WATERTIGHT", there[kind]))
                row.setdefault(kind, []).append(len(there[kind]) / seconds / 1e6)
                errors += wrong(accel, kind, kernel, sets[kind], truth[kind])
            p = accel.on_device.kernel("closest" + suffix, "WATERTIGHT").properties(BLOCK)
            print(f"{mesh:10} {name:28} " + " ".join(f"{row[k][-1]:8.0f}" for k in KINDS)
                  + f" | {p['registers']:3.0f} registers, {p['local_bytes']:.0f} local, {p['occupancy']:.2f}", flush=True)  # fmt: skip
    print("geometric means over the meshes")
    for name, row in rates.items():
        means = [math.exp(sum(map(math.log, row[k])) / len(row[k])) for k in KINDS]
        print(f"{name:28} " + " ".join(f"{m:8.0f}" for m in means))
    options.output.write_text(json.dumps(rates, indent=1))
    print(f"{errors} wrong results")
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())

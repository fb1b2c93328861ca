"""The long runs of rows 1 to 8 of the hard cases: rays within closed meshes that must not get out.

  build.py bench leaks [--rays 1e8] [--kinds BVH,KD_TREE] [--device cuda]

Every structure and mesh gets the number of rays asked for, shared among the kinds of rays. Writes what was run, and
what got out, to tests/bench/records/leaks-DEVICE.json, kept in the repository: a row as soon as it is known, in place of
the one of the same structure and mesh.
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "native"), str(ROOT / "tests")]

from luch.accel import KINDS, Accel  # noqa: E402
from support import closed_meshes  # noqa: E402
from support.checkout import commit  # noqa: E402


def run(kind: str, device: str, count: int) -> Iterator[dict[str, Any]]:
    """One structure: a row a mesh."""
    for name in closed_meshes.MESHES:
        start = time.perf_counter()
        accel = Accel(*closed_meshes.MESHES[name], kind=kind, device=device)
        found = {rays: closed_meshes.leaks(accel, name, rays, count // len(closed_meshes.RAYS))
                 for rays in closed_meshes.RAYS}  # fmt: skip
        out, traced = (sum(pair[k] for pair in found.values()) for k in (0, 1))
        print(f"{kind:18} {name:20} {out} of {traced:,}  ({time.perf_counter() - start:.1f} s)", flush=True)
        yield {"kind": kind, "mesh": name, "rays": traced, "leaks": out,
               "leaks_by_rays": {rays: pair[0] for rays, pair in found.items() if pair[0]}}  # fmt: skip


def keep(row: dict[str, Any], target: Path) -> None:
    """Puts a row into the record, with its date and commit."""
    rows = json.loads(target.read_text(encoding="utf-8"))["rows"] if target.exists() else []
    place = {(old["kind"], old["mesh"]): k for k, old in enumerate(rows)}.get((row["kind"], row["mesh"]), len(rows))
    rows[place : place + 1] = [row | {"date": datetime.date.today().isoformat(), "commit": commit()}]
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")


def main() -> int:
    """0 when nothing got out."""
    parser = argparse.ArgumentParser(prog="build.py bench leaks", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--rays", type=float, default=1e6, help="a mesh and structure (default 1e6)")
    parser.add_argument("--kinds", default=",".join(kind for kind in KINDS if kind != "BRUTE_FORCE"))
    parser.add_argument("--device", default="CPU", type=str.upper, choices=["CPU", "CUDA"])
    options = parser.parse_args()
    target, total = ROOT / "tests" / "bench" / "records" / f"leaks-{options.device.lower()}.json", 0
    for kind in options.kinds.split(","):
        for row in run(kind, options.device, int(options.rays)):
            keep(row, target)
            total += row["leaks"]
    print(f"{total} rays got out; {target.relative_to(ROOT)} written")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())

"""What a scene's own kernels take of a GPU: registers, stack, spills, bytes of code. No GPU is asked; nvcc compiles.

  build.py bench kernels SCENE.luch ... [--architecture 90] [--docs]

Every scene's stages and the kernels that trace it are compiled as a render compiles them (the same sources and flags,
by nvcc in place of NVRTC) and ptxas tells of each. Kept in tests/bench/records/kernels.json; --docs writes the table of
docs/cuda.md. The processor seconds are nvcc's for the stages: front end, optimiser, ptxas.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

from luch.cuda import compiler  # noqa: E402
from luch.cuda.host import HostScene  # noqa: E402
from luch.cuda.scene_kernels import STAGES, sources_of  # noqa: E402
from luch.cuda.trace import ray_kernels  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.scenefile import read_scene  # noqa: E402
from support.checkout import commit  # noqa: E402
from support.pages import replace_between  # noqa: E402

RECORD = ROOT / "tests" / "bench" / "records" / "kernels.json"
PAGE = ROOT / "docs" / "cuda.md"
# What ptxas -v says of an entry.
ENTRY = re.compile(r"Compiling entry function '(\w+)'.*?(\d+) bytes stack frame, (\d+) bytes spill stores, "
                   r"(\d+) bytes spill loads.*?Used (\d+) registers", re.S)  # fmt: skip


def compiled(module: str, precision: str, flags: Sequence[str], programs: str, architecture: int) -> dict[str, Any]:
    """Kernels of a module by name, bytes of its code, processor seconds. Raises RuntimeError if it does not compile."""
    include, kernels = compiler.source_folders()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / compiler.SCENE_PROGRAMS).write_text(programs, encoding="utf-8")
        target = Path(folder) / "module.cubin"
        before = os.times()
        result = subprocess.run(
            ["nvcc", "-cubin", f"-arch=sm_{architecture}", "-Xptxas", "-v", *compiler.flags(precision), *flags,
             f"-I{include}", f"-I{kernels}", f"-I{folder}", str(compiler.source_of(module)), "-o", str(target)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        after = os.times()
        if result.returncode:
            raise RuntimeError(f"{module}: {result.stderr[:4000]}")
        rows = {
            name: dict(zip(("stack", "spilled", "filled", "registers"), map(int, rest), strict=True))
            for name, *rest in ENTRY.findall(result.stdout + result.stderr)
        }
        spent = after.children_user + after.children_system - before.children_user - before.children_system
        return {"kernels": rows, "code_bytes": target.stat().st_size, "seconds": round(spent, 1)}


def kernels_of(scene: Scene, architecture: int) -> dict[str, Any]:
    """Of the stages and of the kernels that trace, those that this scene launches."""
    host = HostScene(scene)
    if not host.prepare():
        raise RuntimeError("cancelled")
    facts, ((blocks, _), _, _, _) = host.facts, host.images
    own = sources_of(facts, blocks, scene)
    precision = scene.settings.precision
    found = compiled(STAGES, precision, own.flags, own.programs, architecture)
    kind, curves = facts["structure"], scene.settings.curve_shape if facts["curves"] else ""
    flags, one = ray_kernels(kind, facts["world_apart"], facts["trees_move"], curves)
    traced = compiled(f"TRACE_{kind}", precision, flags, "", architecture)["kernels"]
    for kind in ("closest", "any"):
        found["kernels"][f"trace_{kind}"] = traced[f"trace_{kind}{one}"]
    return found


def table(record: dict[str, Any]) -> str:
    """For docs/cuda.md."""
    lines = [
        f"sm_{record['architecture']}, nvcc {record['nvcc']}, commit {record['commit']}; registers / bytes of stack / bytes stored in spills",
        "",
        "| scene | shade_surfaces | find_light | add_shadows | trace closest | trace any | code, all stages | processor seconds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, told in sorted(record["scenes"].items()):
        kernels = told["kernels"]
        cells = [
            "{registers} / {stack} / {spilled}".format(**kernels[kernel]) if kernel in kernels else ""
            for kernel in ("shade_surfaces", "find_light", "add_shadows", "trace_closest", "trace_any")
        ]
        lines.append(f"| {name} | {' | '.join(cells)} | {told['code_bytes'] / 1000:.0f} kB | {told['seconds']} |")
    return "\n".join(lines)


def main() -> int:
    """Compiles, keeps, prints."""
    parser = argparse.ArgumentParser(prog="build.py bench kernels", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("scenes", type=Path, nargs="*")
    parser.add_argument("--architecture", type=int, default=90)
    parser.add_argument("--docs", action="store_true", help="write docs/cuda.md")
    options = parser.parse_args()
    if options.scenes:
        version = subprocess.run(["nvcc", "--version"], capture_output=True, text=True, check=True).stdout
        record: dict[str, Any] = {
            "commit": commit(),
            "architecture": options.architecture,
            "nvcc": re.findall(r"release ([\d.]+)", version)[0],
            "scenes": {path.stem: kernels_of(read_scene(path), options.architecture) for path in options.scenes},
        }
        RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    print(table(record))
    if options.docs:
        replace_between(PAGE, "kernels", table(record))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Edits at high rate: view_update so many times in so many seconds, then the view must show the last state.

  .venv/bin/python tests/bench/viewport.py [--edits 1000] [--seconds 10] [--device CUDA]

Says how long an update took Blender's thread, how much memory grew, and whether the picture is that of a fresh view.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import bpy  # noqa: E402
import numpy as np  # noqa: E402
from support.viewports import WAIT_S, Window, edits, room_with_a_cube, shown  # noqa: E402

import addon  # noqa: E402
from addon.viewport import Viewport  # noqa: E402


def resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 1024.0**2


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--edits", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--device", choices=["CPU", "CUDA"], default="CPU")
    asked = parser.parse_args()
    addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    room_with_a_cube(bpy.context.scene)
    setattr(bpy.context.scene.luch, "device", asked.device)
    window, view = Window(), Viewport()
    shown(view, window)
    before, spent = resident_mib(), []
    update = view.update

    def timed(*arguments: Any) -> None:
        began = time.perf_counter()
        update(*arguments)
        spent.append(time.perf_counter() - began)

    setattr(view, "update", timed)
    began = time.perf_counter()
    edits(asked.edits, asked.seconds, window, view)
    took = time.perf_counter() - began
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None, view.text
    right = np.array_equal(view.preview.picture.pixels, shown(Viewport(), window))
    print(
        f"{view.preview.stats['device']}: {asked.edits} edits in {took:.1f} s; an update takes {1e3 * np.median(spent):.1f} ms, at most"
        f" {1e3 * max(spent):.1f}; {resident_mib() - before:.1f} MiB more; the last state"
        f" {'is shown' if right else 'IS NOT SHOWN'}"
    )
    view.stop(wait=True)
    addon.unregister()
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())

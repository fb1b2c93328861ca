"""Writes a .blend file's frame as one .luch scene. Started by build.py."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import bpy

from buildtools.inside import session


def main(options: dict[str, Any]) -> int:
    from luch.scenefile import write_scene

    from addon.engine import capture_scene

    scene = session.open_file(options["file"])
    if options["frame"] is not None:
        scene.frame_set(options["frame"])
    started = time.perf_counter()
    exported = capture_scene(scene, bpy.context.view_layer)
    seconds = time.perf_counter() - started
    path = Path(options["output"])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_scene(exported, str(path))
    print(f"exported in {seconds:.2f} s: {path} ({path.stat().st_size / 1e6:.1f} MB)")
    for warning in exported.warnings:
        print(f"  {warning}")
    return 0


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))

"""Reports what accuracy costs in a .blend file's frame, or in the demo scene. Started by build.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy

from buildtools.inside import session
from buildtools.places import OUT


def main(options: dict[str, Any]) -> int:
    from luch.cli import main as luch
    from luch.scenefile import write_scene

    from addon.engine import capture_scene

    source = options["file"]
    if source is None:
        session.build_demo()
    scene = session.open_file(source)
    if options["frame"] is not None:
        scene.frame_set(options["frame"])
    stem = Path(source).stem if source else "demo"
    folder = Path(options["output"] or OUT / "report" / stem)
    folder.mkdir(parents=True, exist_ok=True)
    exported = folder / f"{stem}.luch"
    write_scene(capture_scene(scene, bpy.context.view_layer), exported)
    try:
        return luch(["report", str(exported), "-o", str(folder), "--seconds", str(options["seconds"]),
                     *(["--size", str(options["size"])] if options["size"] else [])])  # fmt: skip
    finally:
        exported.unlink()


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))

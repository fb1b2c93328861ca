"""Renders a .blend file, or the demo scene, and leaves picture, layers and statistics. Started by build.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy

from buildtools.inside import session
from buildtools.places import OUT

DEMO_SAMPLES = 64


def main(options: dict[str, Any]) -> int:
    source = options["file"]
    if source is None:
        session.build_demo()
        options["samples"] = options["samples"] or DEMO_SAMPLES
    scene = session.open_file(source, options["engine"])
    if options["frame"] is not None:
        scene.frame_set(options["frame"])
    if options["scale"] is not None:
        scene.render.resolution_percentage = max(1, round(scene.render.resolution_percentage * options["scale"]))
    session.choose_samples(scene, options["samples"], options["time"], options["seed"])
    scene.luch.verify = bool(options["verify"]) or scene.luch.verify
    if options["error"] is not None and options["engine"] == "LUCH":
        session.choose_error(scene, options["error"], options["samples"])
    render = session.render_frame(scene)

    stem = Path(source).stem if source else "demo"
    asked = [Path(options["output"])] if options["output"] else [OUT / f"{stem}.png", OUT / f"{stem}.exr"]
    for path in asked:
        session.save_result(scene, path)
    report = asked[0].with_suffix(".json")
    report.write_text(json.dumps(_statistics(options["engine"], scene, render), indent=1) + "\n", encoding="utf-8")
    print(f"rendered {render.width} x {render.height} in {render.wall_s:.1f} s")
    for path in [*asked, report]:
        print(f"  {path}")
    return 0


def _statistics(engine: str, scene: bpy.types.Scene, render: session.Render) -> dict[str, Any]:
    statistics: dict[str, Any] = {
        "engine": engine,
        "blender": bpy.app.version_string,
        "file": bpy.data.filepath or None,
        "scene": scene.name,
        "frame": scene.frame_current,
        "width": render.width,
        "height": render.height,
        "wall_seconds": round(render.wall_s, 3),
        "cpu_seconds": round(render.cpu_s, 3),
    }
    if engine == "LUCH":
        from addon import engine as luch_engine

        statistics["luch"] = luch_engine.last_stats.get(scene.name, {})
    return statistics


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))

"""One render in one process, as the reference was made: started by scenes.py, answers with one JSON line.

Argument: {"file", "engine", "samples", "seed", "width", "height", "window": [x0, y0, x1, y1] in pixels from
the bottom left, "output"}. The scene's own camera, frame
and settings; nothing that takes light away or cleans noise.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

from buildtools.inside import session


def main() -> None:
    job = json.loads(sys.argv[1])
    scene = session.open_file(job["file"], job["engine"])
    session.choose_size(scene, job["width"], job["height"])
    session.choose_window(scene, job["window"])
    scene.render.use_persistent_data = False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.time_limit = 0.0
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    session.choose_samples(scene, job["samples"], seed=job["seed"])
    render = session.render_frame(scene)
    session.save_result(scene, Path(job["output"]))
    result = {
        "wall_s": render.wall_s,
        "cpu_s": render.cpu_s,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    if job["engine"] == "LUCH":
        from addon import engine

        result["luch"] = engine.last_stats.get(scene.name, {})
    print("RESULT " + json.dumps(result))


if __name__ == "__main__":
    main()

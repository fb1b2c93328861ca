"""How renders end that do not reach their end: interrupted, cancelled, or broken at any stage."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

from luch.render import Progress, render
from luch.scene import Camera, Film, Material, Scene, Settings
from luch.shader import ProgramBuilder

from support.checkout import environment
from support.effects import closure, program
from support.media import at, box, bulb, placed

# Where a render can fail before its result is delivered, and after.
STAGES = (
    "addon.report.Reporter.__init__", "addon.report.Reporter.warn", "addon.export.scene.export_settings",
    "addon.result.ResultWriter.__enter__", "luch.render.check_scene", "luch.kept.effects_of",
    "luch.render._renderer_for", "luch.render._Loop.prepare", "luch.render._Loop._step", "luch.render._Loop._look",
    "luch.render.ledger.shares", "addon.report.Reporter.progress", "addon.result._fit",
)  # fmt: skip
# The result is delivered: what fails now is told, and Blender has a picture.
LATE_STAGES = ("addon.report.Reporter.statistics", "addon.result.ResultWriter.stamp", "addon.report.record.line")

# SIGINT is set anew: a process started in the background of a script inherits it ignored. The time limit
# ends a render that no interrupt reached.
INTERRUPTED = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import bpy, addon
addon.register()
scene = bpy.context.scene
scene.render.engine = "LUCH"
scene.render.resolution_x = scene.render.resolution_y = 64
scene.luch.samples = 1 << 20
scene.luch.time_limit = 20.0
print("ready", flush=True)
try:
    bpy.ops.render.render(write_still=False)
except RuntimeError as error:
    print("ended:", error, flush=True)
scene.luch.samples = 1
print("again:", bpy.ops.render.render(), flush=True)
"""

BROKEN = """
import json, sys, unittest.mock
import bpy, addon, luch.render
addon.register()
scene = bpy.context.scene
scene.render.engine = "LUCH"
scene.render.resolution_x = scene.render.resolution_y = 16
scene.luch.samples = 2
told = {}
for stage in json.loads(sys.argv[1]):
    with unittest.mock.patch(stage, side_effect=RuntimeError(stage + " broke")):
        try:
            told[stage] = str(bpy.ops.render.render())
        except RuntimeError as error:
            told[stage] = str(error)
again = bpy.ops.render.render()
print("told:", json.dumps([told, "FINISHED" in again]), flush=True)
"""


def interrupt(after_s: float = 1.5) -> tuple[float, str, bool]:
    """Ctrl-C during a render in a process of its own: seconds until it had ended, the error it ended with, and whether
    the process then rendered once more and left with 0."""
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                          text=True, env=environment()) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            assert any(line.startswith("ready") for line in process.stdout)
            time.sleep(after_s)  # well into the render
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            error = next(line for line in process.stdout if line.startswith("ended:"))
            seconds = time.monotonic() - sent
            again = any("FINISHED" in line for line in process.stdout if line.startswith("again:"))
            return seconds, error, again and process.wait(timeout=20) == 0
        finally:
            process.kill()


def veils(device: str = "CPU", count: int = 200) -> Scene:
    """Panes that let most light through, of which a path and each of its shadow rays look through all, in a bright
    room of sixty bounces, with one thread: a batch of paths takes half a second and more."""

    def pane(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_TRANSPARENT", {}, weight=(0.95, 0.96, 0.97))
        closure(builder, "CLOSURE_DIFFUSE", {"color": (0.5, 0.6, 0.7)}, weight=(0.05, 0.04, 0.03))

    boxes = [box(f"Pane {k}", (1.0 + 0.01 * k,) * 3) for k in range(count)]
    scene = placed(boxes, [Material(f"Pane {k}", program(pane)) for k in range(count)],
                   lights=[bulb((0.1 * k, 0.5, 0.0)) for k in range(10)],
                   camera=Camera(matrix=at(0.0, 0.0, 0.5), lens_mm=20.0), film=Film(width=256, height=256))  # fmt: skip
    scene.settings = Settings(samples=1 << 20, threads=1, device=device, max_bounces=60, diffuse_bounces=60,
                              transparent_bounces=1024, min_transparent_bounces=1024, estimate_error=False)  # fmt: skip
    return scene


def cancel(scene: Scene, after_s: float) -> float:
    """Seconds from the caller's no, so long after samples began to be traced, to the end of the render."""
    began: list[float] = []
    no: list[float] = []

    def goes_on(progress: Progress) -> bool:
        now = time.perf_counter()
        if not progress.preparing:
            began.append(now)
        if began and now - began[0] >= after_s and not no:
            no.append(now)
        return not no

    result = render(scene, progress=goes_on)
    assert result.cancelled and no, "the render ended before it could be cancelled"
    return time.perf_counter() - no[0]


def break_stages(stages: tuple[str, ...]) -> tuple[list[str], int]:
    """Renders in one process of its own, each with a stage that fails: the stages of which the caller saw no error
    (a last one, "the next render", if that failed), and the process's exit status."""
    done = subprocess.run([sys.executable, "-c", BROKEN, json.dumps(stages)], capture_output=True, text=True,
                          env=environment(), timeout=300, check=False)  # fmt: skip
    said = [line.removeprefix("told: ") for line in done.stdout.splitlines() if line.startswith("told: ")]
    if not said:
        return list(stages), done.returncode
    told, again = json.loads(said[0])
    silent = [stage for stage in stages if f"{stage} broke" not in told[stage]]
    return silent + ([] if again else ["the next render"]), done.returncode

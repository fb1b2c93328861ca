"""Ctrl-C in a terminal ends a render, and the process can go on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# SIGINT is set anew: a process started in the background of a script inherits it ignored. The time limit
# ends a render that no interrupt reached.
RENDER = """
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


@pytest.mark.promise(3)
def test_an_interrupt_ends_the_render_within_two_seconds_and_not_the_process() -> None:
    paths = [str(ROOT), str(ROOT / "native"), *filter(None, [os.environ.get("PYTHONPATH")])]
    with subprocess.Popen(
        [sys.executable, "-c", RENDER],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    ) as process:
        try:
            assert process.stdout is not None
            assert any(line.startswith("ready") for line in process.stdout)
            time.sleep(1.5)  # well into the render
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            ended = next(line for line in process.stdout if line.startswith("ended:"))
            assert time.monotonic() - sent < 2.0
            assert "interrupted" in ended
            assert any("FINISHED" in line for line in process.stdout if line.startswith("again:"))
            assert process.wait(timeout=20) == 0
        finally:
            process.kill()

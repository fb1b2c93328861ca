"""A report (luch.report) made by a process of its own, so that Blender goes on: started, watched, ended."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import bpy
from luch import denoise
from luch.scene import Scene

KILLED_AFTER_S = 5.0  # what a process that was asked to end may still take: it writes what it found


class ReportJob:
    """One process that makes a report of a scene. Raises OSError where it cannot be started."""

    def __init__(self, scene: Scene, folder: Path, seconds: float, name: str) -> None:
        from luch.scenefile import write_scene

        self.folder, self.fraction, self.doing, self.left_s = folder, 0.0, "starting", seconds
        self.sentences: list[str] = []
        self._errors: list[str] = []
        self._temporary = tempfile.TemporaryDirectory(prefix="luch_report_")
        source = Path(self._temporary.name) / f"{name}.luch"
        command = [_python(), "-m", "luch", "report", str(source), "-o", str(folder), "--seconds", f"{seconds:g}",
                   "--progress"]  # fmt: skip
        try:
            write_scene(scene, source)
            self._process = subprocess.Popen(
                command, env=_environment(), text=True, encoding="utf-8", stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
        except OSError:
            self._temporary.cleanup()
            raise
        self._readers = [threading.Thread(target=self._read_progress, daemon=True),
                         threading.Thread(target=self._read_errors, daemon=True)]  # fmt: skip
        for reader in self._readers:
            reader.start()

    @property
    def page(self) -> Path:
        return self.folder / "report.html"

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def cancel(self) -> None:
        """Asks it to end; it still writes what it found. Returns at once."""
        if self.running:
            self._process.send_signal(signal.SIGINT)

    def finish(self) -> str:
        """Waits for the process and takes its files away; "" or why there is no report."""
        self._process.wait()
        for reader in self._readers:
            reader.join()
        self._temporary.cleanup()
        if self.sentences:
            return ""
        return " ".join(self._errors).strip() or f"the process ended with status {self._process.returncode}"

    def kill(self) -> None:
        """Ends it now; for Blender's own end."""
        if self.running:
            self.cancel()
            try:
                self._process.wait(KILLED_AFTER_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self.finish()

    def _read_progress(self) -> None:
        """Lines of JSON while it works, then sentences and the page's path."""
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for text in map(str.strip, lines):
                if text.startswith("{"):
                    told: dict[str, Any] = json.loads(text)
                    self.fraction, self.doing, self.left_s = told["fraction"], told["doing"], told["left"]
                elif text and text != str(self.page):
                    self.sentences.append(text)

    def _read_errors(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            self._errors += map(str.strip, lines)


def file_name(scene: Any) -> str:
    """The file's and the scene's, fit for a path."""
    return re.sub(r"[^\w.-]+", "_", f"{Path(bpy.data.filepath).stem}_{scene.name}".strip("_"))


def folder_of(scene: Any) -> Path:
    """Where the report of a scene goes."""
    path = scene.luch.report_folder
    if path.startswith("//") and not bpy.data.filepath:
        return Path(bpy.app.tempdir) / "luch_report"
    return Path(bpy.path.abspath(path)) / file_name(scene)


def _python() -> str:
    """Blender's own interpreter; where Blender is a module of another, that one."""
    return sys.executable


def _environment() -> dict[str, str]:
    """The new process finds the same luch, NumPy and Open Image Denoise as this one."""
    import luch
    import numpy

    homes = [str(Path(str(module.__file__)).parents[1]) for module in (luch, numpy)]
    variables = dict(os.environ)
    variables["PYTHONPATH"] = os.pathsep.join([*homes, *filter(None, [variables.get("PYTHONPATH", "")])])
    if denoise.available():
        variables["LUCH_OIDN"] = denoise.library()._name
    return variables

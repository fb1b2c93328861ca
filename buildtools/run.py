"""Running programs: one place that prints what runs and turns a red exit into a BuildFailure."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path
from typing import Dict, List, Optional

from buildtools.failure import BuildFailure
from buildtools.places import NATIVE, ROOT


def environment() -> Dict[str, str]:
    """The caller's environment, with native/ and the root importable by every child."""
    variables = dict(os.environ)
    variables["PYTHONPATH"] = os.pathsep.join([str(NATIVE), str(ROOT)])
    variables.setdefault("PYTHONUNBUFFERED", "1")
    return variables


def status(command: List[str], cwd: Path = ROOT, extra: Optional[Dict[str, str]] = None) -> int:
    """Run with output passed through; the exit status. extra: more environment variables."""
    return subprocess.run(command, cwd=cwd, env={**environment(), **(extra or {})}, check=False).returncode


def require(command: List[str], failure: str, cwd: Path = ROOT) -> None:
    """Run with output passed through; raises BuildFailure(failure) unless it exits 0."""
    code = status(command, cwd)
    if code != 0:
        raise BuildFailure(f"{failure} (exit {code}: {' '.join(shlex.quote(part) for part in command[:6])} ...)")


def output(command: List[str]) -> Optional[str]:
    """Standard output of a quick program, or None if it cannot run or fails."""
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
    except OSError:
        return None
    return result.stdout.strip() if result.returncode == 0 else None

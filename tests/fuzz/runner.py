"""Cases in a process of their own, which may crash or hang; the process that watches it goes on with the next seed.

`build.py fuzz --seconds 600 --seed 1` runs it; a case again: `... --seed N --count 1 --kinds scene`.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

KINDS = ("scene", "damaged", "file", "header")
SLOW_KINDS = ("blender",)  # asked for by name
HANG_S = 30.0  # a case that takes longer is killed
MOST_MEMORY_BYTES = 6 << 30  # address space; a case needs some MiB
ROOT = Path(__file__).resolve().parents[2]


def child(kinds: tuple[str, ...], first: int, count: int, seconds: float) -> None:
    """Runs cases; a line of JSON before each and after it."""
    from fuzz.cases import Finding, run_case

    if "libasan" not in os.environ.get("LD_PRELOAD", ""):  # whose shadow takes terabytes of addresses
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))
    ends = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            for kind in kinds:
                if time.monotonic() > ends:
                    return
                print(json.dumps({"begin": [kind, seed]}), flush=True)
                faulthandler.dump_traceback_later(HANG_S, exit=True)
                try:
                    outcome = run_case(kind, seed, Path(folder))
                except Finding as finding:
                    outcome = f"FINDING {finding}"
                faulthandler.cancel_dump_traceback_later()
                print(json.dumps({"end": [kind, seed], "outcome": outcome}), flush=True)


class Summary:
    """Counts of outcomes, and what was found: (kind, seed, what)."""

    def __init__(self) -> None:
        self.outcomes: Counter[str] = Counter()
        self.findings: list[tuple[str, int, str]] = []
        self.next_seed = 0

    @property
    def cases(self) -> int:
        return sum(self.outcomes.values()) + len(self.findings)


def fuzz(seconds: float, seed: int, count: int = 1 << 40, kinds: tuple[str, ...] = KINDS) -> Summary:
    """Cases of `count` seeds from `seed` on, each of every kind, for so many seconds at most."""
    summary, ends, last = Summary(), time.monotonic() + seconds, seed + count
    while seed < last and time.monotonic() < ends:
        seed = _watch(summary, kinds, seed, last - seed, ends)
    summary.next_seed = seed
    return summary


def _watch(summary: Summary, kinds: tuple[str, ...], first: int, count: int, ends: float) -> int:
    """One child until it ends or dies; returns the seed to go on with."""
    command = [sys.executable, "-X", "faulthandler", "-m", "fuzz.runner", "--child", "--seed", str(first), "--count", str(count),
               "--seconds", str(max(0.0, ends - time.monotonic())), "--kinds", *kinds]  # fmt: skip
    paths = os.pathsep.join(path for path in [*sys.path, str(ROOT / "tests")] if path)
    running: tuple[str, int] | None = None
    with tempfile.TemporaryFile("w+") as errors, subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=ROOT, env={**os.environ, "PYTHONPATH": paths}
    ) as process:  # fmt: skip
        assert process.stdout is not None
        for line in process.stdout:
            if not line.startswith('{"'):  # Blender speaks, too
                continue
            told = json.loads(line)
            if "begin" in told:
                running = (told["begin"][0], told["begin"][1])
                continue
            assert running is not None
            if told["outcome"].startswith("FINDING"):
                summary.findings.append((*running, told["outcome"]))
                print(f"{running[0]} {running[1]}: {told['outcome']}", flush=True)
            else:
                summary.outcomes[told["outcome"]] += 1
            first, running = running[1], None
        status = process.wait()
        if running is None:
            if status != 0:
                errors.seek(0)
                raise RuntimeError(f"the fuzzing process ended with {status}: {errors.read()[-4000:]}")
            return first + count if time.monotonic() < ends else first + 1
        errors.seek(0)
        what = f"FINDING the process died ({status}): {errors.read()[-3000:]}"
    summary.findings.append((*running, what))
    print(f"{running[0]} {running[1]}: {what}", flush=True)
    return running[1] + 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=1 << 40)
    parser.add_argument("--kinds", nargs="+", choices=KINDS + SLOW_KINDS, default=list(KINDS))
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(tuple(arguments.kinds), arguments.seed, arguments.count, arguments.seconds)
        return 0
    summary = fuzz(arguments.seconds, arguments.seed, arguments.count, tuple(arguments.kinds))
    print(
        f"{summary.cases} cases up to seed {summary.next_seed}: {dict(summary.outcomes)}, {len(summary.findings)} findings"
    )
    return 1 if summary.findings else 0


if __name__ == "__main__":
    sys.exit(main())

"""`python -m luch report`: makes a report and tells how far it is."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable

from luch.image import openimageio
from luch.report import Cancelled, Told, make_report, write
from luch.scene import Scene

CANCELLED = 130  # exit status after Ctrl+C, as shells have it
TELL_SECONDS = 0.5


def run(options: argparse.Namespace, scene: Scene, goes_on: Callable[[], bool]) -> int:
    """The exit status. Ended early, it writes what was found so far."""
    openimageio()  # a missing library is told before the work, not after
    if options.device is not None:
        scene.settings.device = options.device
    if options.threads is not None:
        scene.settings.threads = options.threads
    teller = _Teller(options.progress, options.quiet)

    def watch(told: Told) -> bool:
        teller.tell(told)
        return goes_on()

    try:
        report, pictures = make_report(scene, options.seconds, watch=watch, size=options.size, title=options.scene.stem)
    except Cancelled:
        reason = f"nothing could be measured within {options.seconds:g} s; give it more with --seconds"
        print(f"luch: {reason if goes_on() else 'ended before anything was measured'}", file=sys.stderr)
        return 1 if goes_on() else CANCELLED
    finally:
        teller.end()
    page = write(report, pictures, options.output)
    for sentence in report.sentences:
        print(sentence)
    print(page)
    return CANCELLED if report.cancelled else 0


class _Teller:
    """Progress: lines of JSON for programs, one line rewritten in place for people."""

    def __init__(self, for_programs: bool, quiet: bool) -> None:
        self._programs = for_programs
        self._people = not for_programs and not quiet and sys.stderr.isatty()
        self._next = 0.0

    def tell(self, told: Told) -> None:
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + TELL_SECONDS
        if self._programs:
            facts = {"fraction": round(told.fraction, 4), "doing": told.doing, "left": round(told.remaining_seconds, 1)}
            print(json.dumps(facts), flush=True)
        elif self._people:
            text = f"{told.fraction:6.1%}  {told.doing}, {told.remaining_seconds:.0f} s left"
            print(f"\r{text:70}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._people:
            print(file=sys.stderr)

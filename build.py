#!/usr/bin/env python3
"""The one door: sets up, builds, renders, exports, tests, benches, packages.

Any Python from 3.9 may start it. It makes `.venv` with a Python 3.13 (Blender 5.2's own) and everything
pinned in requirements.txt, compiles native/, and runs the rest there. `build.py COMMAND --help` tells more.
"""

from __future__ import annotations

import argparse
import os
import sys

from buildtools import commands
from buildtools.compile_core import levels
from buildtools.failure import BuildFailure


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="build.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    compiling = argparse.ArgumentParser(add_help=False)
    compiling.add_argument(
        "--isa",
        default=os.environ.get("LUCH_ISAS", "v2;v3;v4"),
        help="x86-64 levels to compile, e.g. v4 or 'v3;v4'; 'here': the plain one and this processor's best "
        "(default: LUCH_ISAS of the environment, or all three)",
    )
    compiling.add_argument("--jobs", type=int, default=0, help="compiler processes at once (default: one per core)")

    def add(name: str, text: str, *, compiles: bool = True, passes_on: bool = False) -> argparse.ArgumentParser:
        parents = [compiling] if compiles else []
        sub = subparsers.add_parser(name, help=text, description=text, parents=parents, allow_abbrev=False)
        sub.set_defaults(run=getattr(commands, name), passes_on=passes_on)
        return sub

    add("setup", "Make .venv with the pinned tools; nothing to do when it is there.", compiles=False)
    build = add("build", "Compile the native core into native/luch.")
    build.add_argument(
        "--sanitize", action="store_true", help="with AddressSanitizer and UBSan, in a folder of its own"
    )

    build.add_argument("--cuda", action="store_true", help="CUDA kernels too, for all architectures; needs nvcc")

    render = add("render", "Render a .blend file, or the demo scene, with Luch inside Blender.")
    render.add_argument("file", nargs="?", help="a .blend file (default: the demo scene, built by its script)")
    render.add_argument("--samples", type=int, help="samples per pixel (default: the file's; the demo: 64)")
    render.add_argument("--time", type=float, help="stop after this many seconds of rendering")
    render.add_argument("--error", type=float, help="stop when the picture's error is that small, e.g. 0.01")
    render.add_argument("--verify", action="store_true", help="hold the claimed error against a second render's")
    render.add_argument("--seed", type=int, help="seed of the sampler")
    render.add_argument("--frame", type=int, help="frame to render (default: the file's current one)")
    render.add_argument("--scale", type=float, help="factor on the resolution, e.g. 0.5")
    render.add_argument("--output", help="PATH.exr (multilayer) or PATH.png (default: both, under out/)")
    render.add_argument("--engine", default="LUCH", choices=["LUCH", "CYCLES"], help="for a look beside (default LUCH)")

    report = add("report", "Report what accuracy costs in a scene: error against time, the price of each effect.")
    report.add_argument("file", nargs="?", help="a .blend file (default: the demo scene, built by its script)")
    report.add_argument("--seconds", type=float, default=60.0, help="how long it may take (default: 60)")
    report.add_argument("--size", type=int, default=0, help="pixels along the longer side (default: as time allows)")
    report.add_argument("--frame", type=int, help="frame to report on (default: the file's current one)")
    report.add_argument("-o", "--output", help="folder for the report (default: out/report/NAME)")

    export = add("export", "Write a .blend file as a .luch scene, which renders without Blender.")
    export.add_argument("file", help="a .blend file")
    export.add_argument("-o", "--output", required=True, help="PATH.luch")
    export.add_argument("--frame", type=int, help="frame to export (default: the file's current one)")

    test = add("test", "Run the tests. Other arguments go to pytest, e.g. -k lights.", passes_on=True)
    test.add_argument(
        "--sanitize", action="store_true", help="tests/native and some hard cases, with AddressSanitizer and UBSan"
    )
    test.add_argument(
        "--watch-kernels",
        action="store_true",
        help="the CUDA kernels that run on fibers, with both sanitizers (minutes)",
    )
    fuzz = add(
        "fuzz", "Random scenes and damaged files, for as long as you like. --count, --kinds too.", passes_on=True
    )
    fuzz.add_argument("--seconds", type=float, default=60.0, help="how long (default 60)")
    fuzz.add_argument("--seed", type=int, default=0, help="the first seed; each is a case of every kind")
    fuzz.add_argument("--sanitize", action="store_true", help="with AddressSanitizer and UBSan")
    bench = add("bench", "Race and compare; other arguments go to the bench. No name: list them.", passes_on=True)
    bench.add_argument("name", nargs="?", help="a file in tests/bench, without .py")
    add("check", "The gate of the house: format, lint, spelling, architecture, types, headers.")
    package = add("package", "Build and validate the extension zip under dist/.")
    package.add_argument(
        "--headers",
        action="append",
        default=[],
        metavar="TAG=FOLDER",
        help="a wheel for another Python too, from the folder of its Python.h, e.g. cp314=/usr/include/python3.14",
    )
    clean = add("clean", "Remove build products (keeps .venv).", compiles=False)
    clean.add_argument("--all", action="store_true", help="remove .venv too")
    return parser


def main() -> int:
    parser = _parser()
    arguments, rest = parser.parse_known_args()
    if rest and not arguments.passes_on:
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    arguments.rest = rest
    if "isa" in arguments:
        arguments.isa = levels(arguments.isa)
    try:
        return int(arguments.run(arguments))
    except BuildFailure as failure:
        print(f"build.py {arguments.command}: {failure}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())

"""What a farm says behind `--` on Blender's command line: `blender -b x.blend -E LUCH -f 1 -- --luch-device CUDA`.

It overrules the file for this process alone. Blender hands words behind `--` to scripts and add-ons; those of others
are left alone, a misspelt one of ours is told by name.
"""

from __future__ import annotations

import argparse
import functools
import sys
from typing import Any, NoReturn

from luch.integrators import NAMES as INTEGRATORS
from luch.samplers import NAMES as SAMPLERS
from luch.stopping import CUSTOM, STEPS, UNLIMITED_SAMPLES


class CommandLineError(ValueError):
    """A `--luch-...` option that does not exist or has no such value."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise CommandLineError(f"Command line: {message}. Luch knows {', '.join(OPTIONS)}.")


OPTIONS = (
    "--luch-device CPU|CUDA",
    "--luch-error 0.01",
    "--luch-time SECONDS",
    f"--luch-quality {'|'.join((*STEPS, CUSTOM))}",
    "--luch-denoise",
    "--luch-samples N",
    "--luch-verify",
    "--luch-adaptive",
    "--luch-gpus N",
    "--luch-seed N",
    f"--luch-sampler {'|'.join(SAMPLERS)}",
    f"--luch-integrator {'|'.join(INTEGRATORS)}",
    "--luch-mergeable",
    "--luch-first-sample N",
    "--luch-samples-in-all N",
    "--luch-without-effect NAME",
    "--luch-force-effect NAME|ALL",
)


@functools.cache
def overrides(words: tuple[str, ...]) -> dict[str, Any]:
    """Names of luch.scene.Settings -> values. words: sys.argv. Raises CommandLineError."""
    if "--" not in words:
        return {}
    own = list(words[words.index("--") + 1 :])
    parser = _Parser(add_help=False, allow_abbrev=False)
    parser.add_argument("--luch-device", choices=("CPU", "CUDA"), type=str.upper)
    parser.add_argument("--luch-gpus", type=int)
    parser.add_argument("--luch-without-effect", action="append", dest="luch_without_effects")
    parser.add_argument("--luch-force-effect", action="append", dest="luch_force_effects")
    parser.add_argument("--luch-error", type=_positive_number, dest="luch_error_limit")
    parser.add_argument("--luch-time", type=_positive_number, dest="luch_time_limit")
    parser.add_argument("--luch-samples", type=int)
    parser.add_argument("--luch-quality", choices=(CUSTOM, *STEPS), type=str.upper)
    parser.add_argument("--luch-denoise", action="store_const", const=True)
    parser.add_argument("--luch-verify", action="store_const", const=True)
    parser.add_argument("--luch-mergeable", action="store_const", const=True)
    for name in ("seed", "first-sample", "samples-in-all"):
        parser.add_argument(f"--luch-{name}", type=_count)
    parser.add_argument("--luch-sampler", choices=SAMPLERS, type=str.upper)
    parser.add_argument("--luch-integrator", choices=INTEGRATORS, type=str.upper)
    parser.add_argument("--luch-adaptive", action="store_const", const=True)
    found, rest = parser.parse_known_args(own)
    unknown = [word for word in rest if word.startswith("--luch")]
    if unknown:
        raise CommandLineError(f"Command line: {unknown[0]} is unknown. Luch knows {', '.join(OPTIONS)}.")
    told = {name.removeprefix("luch_"): value for name, value in vars(found).items() if value is not None}
    if "error_limit" in told:
        told.setdefault("samples", UNLIMITED_SAMPLES)
    if told.get("mergeable"):
        told["denoise"] = False  # parts are sums of samples; what they merge to may be denoised
    if told.keys() & {"error_limit", "samples", "mergeable"}:
        told.setdefault("quality", CUSTOM)  # a dial in the file gives way
    return told


def _count(text: str) -> int:
    value = int(text)
    if not 0 <= value < 1 << 31:
        raise argparse.ArgumentTypeError(f"{text} is not from 0 to 2147483647")
    return value


def _positive_number(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def current() -> dict[str, Any]:
    """Of this process."""
    return overrides(tuple(sys.argv))

"""Nanoseconds per element of the elementary functions in a plain loop, beside the C library's."""

from __future__ import annotations

import sys
import time

import numpy as np

COUNT = 16384  # fits the first two cache levels
ONE = ["sin", "cos", "tan", "asin", "acos", "atan", "exp", "exp2", "log", "log2", "libm_sin"]
TWO = ["atan2", "pow", "fmod", "libm_pow"]


def main(arguments: list[str]) -> int:
    """Prints one line per function; with names as arguments, of those alone."""
    from luch import core

    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.01, 10, COUNT).astype(np.float32), rng.uniform(-3, 3, COUNT).astype(np.float32)
    print(f"core {core.__name__}, best of 60 runs over {COUNT} floats")
    for name in arguments or [*ONE, *TWO]:
        function = getattr(core.math, name)
        values = (x, y) if name in TWO else (x,)
        best = float("inf")
        for _ in range(60):
            start = time.perf_counter()
            function(*values)
            best = min(best, time.perf_counter() - start)
        print(f"{name:9} {best / COUNT * 1e9:6.2f} ns")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Chooses the compiled core for this processor: AVX-512 (v4), AVX2 (v3) or plain x86-64 (v2).

It is loaded when something of it is asked for, not before: Blender starts without that time, and where the core is
missing or of another Python the add-on still registers, and a render can tell why it fails.

``LUCH_ISA=v2|v3|v4`` in the environment overrides the choice.
"""

from __future__ import annotations

import importlib
import os
from types import ModuleType
from typing import Any

_NEEDS = {
    "v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "v3": {"avx2", "bmi1", "bmi2", "fma", "f16c", "movbe"},
    "v2": set[str](),
}


def _processor_flags() -> set[str]:
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as info:
            for line in info:
                if line.startswith("flags"):
                    return set(line.split(":", 1)[1].split())
    except OSError:  # not Linux: only the plain module can be trusted
        return set()
    return set()


def levels_here() -> list[str]:
    """Those that this processor runs, the best first."""
    flags = _processor_flags()
    return [isa for isa, needs in _NEEDS.items() if needs <= flags]


def _load() -> ModuleType:
    wished = os.environ.get("LUCH_ISA")
    levels = [wished] if wished else levels_here()
    errors = []
    for isa in levels:
        try:
            return importlib.import_module(f"luch._core_{isa}")
        except ImportError as error:
            errors.append(f"_core_{isa}: {error}")
    raise ImportError("Luch's compiled core is missing; run `python3 build.py build`. " + "; ".join(errors))


class _Core:
    """The compiled module, as soon as one of its names is asked for. Raises ImportError where there is none."""

    def __getattr__(self, name: str) -> Any:
        self.__dict__.update(vars(_load()))  # from now on Python finds names without asking here
        try:
            return self.__dict__[name]
        except KeyError:
            raise AttributeError(f"Luch's compiled core has no {name!r}.") from None


core = _Core()

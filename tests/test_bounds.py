"""Numbers that decide accuracy stand in one header, with their reasons (docs/numerics.md), and nowhere else."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
INCLUDE = ROOT / "native" / "include"

# Smaller ones keep a float from 0 or from the end of its range: nothing that a picture shows is of their size.
GUARD, SMALL = 1e-20, 1e-3
# Whole files of coefficients: of functions, of tables, of the air.
COEFFICIENTS = {"math/fn.h", "bsdf/tables.h", "bsdf/sheen_table.h", "bsdf/film_table.h", "sky/single_scattering.cpp",
                "sky/multiple_scattering.cpp"}  # fmt: skip
# What is as small and decides no picture: file -> its literals.
NO_THRESHOLDS = {
    "bsdf/beckmann.h": "2.81022636e-08 3.43273939e-07 3.5233877e-06 4.39150654e-06 0.00021858087 0.000200214257 "
    "0.000100950558",  # Giles's polynomials
    "bsdf/fresnel.h": "1.00071",  # the fit of Kulla and Conty
    "sampling/hash.h": "5.9604644775390625e-8",  # 2^-24, 2^-32, 2^-31: integers become numbers of [0, 1)
    "shade/textures/hash.h": "2.3283064365386963e-10 4.656612873077393e-10",
    "accel/choice.cpp": "1e-9 1e-6 1e-4",  # seconds; the rays that structures are tried with
    "accel/build_tree2_spatial.cpp": "1e-5",  # what a tree costs, not what it holds
    "accel/slices.cpp": "2.0f*EPS",  # above() and below() of eight lanes
    "accel/wide_ray.h": "4.0f*SHEAR_ERROR 0.5f*SHEAR_ERROR",  # as good as parallel: math/bounds.h, 1
    "geometry/box.h": "6.0f*SHEAR_ERROR",
    "camera.cpp": "1e-3",  # millimetres
    "luch/accuracy.py": "0.001",  # statistics, under names of their own: docs/accuracy.md
    "luch/ledger.py": "0.0001",
    "luch/curve.py": "1e-09",
    "luch/cuda/several.py": "1e-06",  # seconds
    "luch/denoise.py": "0.001",
    "luch/quality.py": "0.001",
    "luch/render.py": "2e-07 4e-09 1e-06",
    "luch/sky.py": "0.0004 0.0008",  # Preetham's fit
    "luch/spectrum.py": "0.0001 1e-09",  # units
    "addon/export/nodes/media.py": "5.670373e-08 1e-06",
}


def _code(text: str) -> str:
    """Without comments and string literals."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', " ", text, flags=re.DOTALL)


NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=e))(?:e[-+]?\d+)?(?=f?(?![\w.]))", re.IGNORECASE)


def is_small(number: float) -> bool:
    """Near 0 or near 1, and neither."""
    return GUARD < abs(number) <= SMALL or 0.0 < abs(abs(number) - 1.0) <= SMALL


def small_of_cpp(text: str) -> list[str]:
    found = [n for line in text.splitlines() for n in NUMBER.findall(_code(line)) if is_small(float(n))]
    # So many units in the last place.
    ulps = re.findall(r"\d[\d.]*f? \* (?:double\()?(?:EPS|SHEAR_ERROR)\b", _code(text))
    return found + [each.replace(" ", "") for each in ulps]


def small_of_python(text: str) -> list[str]:
    return [repr(node.value) for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Constant) and isinstance(node.value, float) and is_small(node.value)]  # fmt: skip


@cache
def small_numbers() -> dict[str, list[str]]:
    """File -> its literals that look as if they decided accuracy, but for math/bounds.h and luch/bounds.py."""
    found: dict[str, list[str]] = {}
    for folder in (INCLUDE / "luch", ROOT / "native" / "cpu", ROOT / "native" / "cuda"):
        for path in sorted(p for p in folder.rglob("*") if p.suffix in (".h", ".cpp", ".cu", ".cuh")):
            name = path.relative_to(folder).as_posix()
            if name not in COEFFICIENTS | {"math/bounds.h"}:
                found[name] = small_of_cpp(path.read_text(encoding="utf-8"))
    for folder, apart in ((ROOT / "native" / "luch", {"bench", "report"}), (ROOT / "addon", {"ui"})):
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).parts
            if not apart & set(parts) and parts != ("bounds.py",):
                found[f"{folder.name}/{'/'.join(parts)}"] = small_of_python(path.read_text(encoding="utf-8"))
    return {name: literals for name, literals in found.items() if literals}


def test_every_number_that_decides_accuracy_stands_in_one_header() -> None:
    """docs/numerics.md; what code needs of them, it takes from math/bounds.h, and Python's own from luch/bounds.py."""
    stray = {name: more for name, literals in small_numbers().items()
             if (more := [n for n in literals if n not in NO_THRESHOLDS.get(name, "").split()])}  # fmt: skip
    assert not stray, "move it to luch/math/bounds.h (Python's to luch/bounds.py), with its reason"


def test_numbers_that_are_agreed_to_be_no_thresholds_are_still_there() -> None:
    found = small_numbers()
    gone = {name: [n for n in agreed.split() if n not in found.get(name, [])] for name, agreed in NO_THRESHOLDS.items()}
    assert not any(gone.values()), gone


@pytest.mark.parametrize(
    "line",
    ["if (x < 1e-5f) return;", "x = min_f(x, 0.999999f);", "double slack = 4e-6;", "a < 8.0f * EPS", "y > 1.0000004f"],
)
def test_a_threshold_is_seen_wherever_it_stands(line: str) -> None:
    assert small_of_cpp(line)
    assert not small_of_cpp(f"// {line}") and not small_of_cpp("max_f(x, 1e-30f) + 0.5f * 1e6f - EPS * x / 1.0f")


def constants_of(header: Path) -> dict[str, float]:
    """Those that are written as numbers."""
    stated = re.findall(r"^inline constexpr (?:float|double) (.*?);", header.read_text(encoding="utf-8"), re.M | re.S)
    pairs = [re.split(r"\s=\s", pair.strip()) for line in stated for pair in line.split(",")]
    return {name: float(value.rstrip("f")) for name, value in pairs if NUMBER.fullmatch(value.rstrip("f"))}


def test_pythons_constants_that_are_the_cores_have_its_values() -> None:
    shared = (ROOT / "native" / "luch" / "bounds.py").read_text(encoding="utf-8").split("# -- Python's own")[0]
    values, core = re.findall(r"^([A-Z_]+) = (\S+)", shared, re.M), constants_of(INCLUDE / "luch" / "math" / "bounds.h")
    assert len(values) == 5 and len(core) > 90
    assert {name: float(value) for name, value in values} == {name: core[name] for name, _ in values}

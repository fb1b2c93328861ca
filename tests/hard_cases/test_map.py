"""docs/numerics.md names the tests of every hard case, and they exist; and where every constant comes from."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "numerics.md"
COUNT = 65  # of the list of hard cases
# | 9 | closed room, primary | `tests/hard_cases/test_geometry.py::test_09_...` (bound) |
ROW = re.compile(r"^\| (\d+) \| ([^|]+) \| (.+) \|$")
# Constants that stand beside the sums that they come from.
BESIDE = {
    "SAGITTA_SLACK": "cpu/accel/build_moving.cpp",
    "WIDEST": "include/luch/accel/wide_ray.h",
}
TEST = re.compile(r"`([\w/]+\.py)::(\w+)`")


def rows() -> dict[int, str]:
    """Number of the case -> what is said of its tests."""
    found = [ROW.match(line) for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return {int(row[1]): row[3] for row in found if row}


@cache
def named_in(path: str) -> set[str]:
    tree = ast.parse((ROOT / "tests" / path).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


def test_every_hard_case_names_its_tests() -> None:
    named = rows()
    assert sorted(named) == list(range(1, COUNT + 1))
    bare = [number for number, said in named.items() if not TEST.search(said)]
    assert not bare, f"cases without a test: {bare}"


def test_every_hard_case_is_held_among_the_hard_cases() -> None:
    """Others may hold it, too: these alone run on the plain core, and together as the list asks for."""
    elsewhere = [number for number, said in rows().items()
                 if not any(path.startswith("hard_cases/") and name in named_in(path)
                            for path, name in TEST.findall(said))]  # fmt: skip
    assert not elsewhere, f"cases without a test under tests/hard_cases: {elsewhere}"


def test_every_test_that_is_named_exists() -> None:
    missing = [f"{path}::{name}" for said in rows().values() for path, name in TEST.findall(said)
               if not (ROOT / "tests" / path).is_file() or name not in named_in(path)]  # fmt: skip
    assert not missing


def test_every_test_with_a_number_is_named() -> None:
    said = rows()
    for path in (ROOT / "tests" / "hard_cases").glob("test_*.py"):
        for name in named_in(f"hard_cases/{path.name}"):
            for number in re.findall(r"(?<=_)\d\d(?=_)", name):
                assert name in said[int(number)], f"docs/numerics.md, case {int(number)}: {name} is not named"


def test_every_constant_that_decides_accuracy_is_derived() -> None:
    header = (ROOT / "native" / "include" / "luch" / "math" / "bounds.h").read_text(encoding="utf-8")
    header += (ROOT / "native" / "luch" / "bounds.py").read_text(encoding="utf-8").partition("# -- Python's own")[2]
    stated = re.findall(r"^(?:inline constexpr (?:float|double) (.*);|([A-Z_]+ = ).*$)", header, re.MULTILINE)
    names = [name for line in stated for name in re.findall(r"([A-Z][A-Z0-9_]+) = ", "".join(line))]
    table = re.findall(r"^\| (`[A-Z][^|]+) \| [^|]+ \| [^|]{20,} \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(names) > 120
    for name, file in BESIDE.items():
        assert re.search(rf"constexpr float {name} = ", (ROOT / "native" / file).read_text(encoding="utf-8"))
    assert sorted([*names, *BESIDE]) == sorted(name for cell in table for name in re.findall(r"`(\w+)`", cell))


def members(header: str, enum: str) -> set[str]:
    text = (ROOT / "native" / "include" / "luch" / header).read_text(encoding="utf-8")
    body = re.search(rf"enum class {enum} : \w+ \{{(.*?)\}};", text, re.DOTALL)
    assert body
    return set(re.findall(r"\b[A-Z][A-Z_]+\b(?=,|\s*$)", re.sub(r"//.*", "", body[1]), re.MULTILINE)) - {"NONE_"}


def test_everything_that_draws_samples_has_a_chi_square() -> None:
    """Closures, lights and phase functions, by their enumerations."""
    text = PAGE.read_text(encoding="utf-8")
    table = text[text.index("Chi-square of samples against density") : text.index("Weaker than the list asks for")]
    of_lobes, of_lamps = members("bsdf/closure.h", "LobeType"), members("light/light.h", "LampKind")
    assert len(of_lobes) == 18 and len(of_lamps) == 5
    listed = set(re.findall(r"`([A-Z_]+)`", table))
    assert listed == of_lobes | of_lamps | members("bsdf/phase.h", "PhaseKind")
    named = TEST.findall(table)
    assert len(named) == 8 and all(name in named_in(path) for path, name in named)

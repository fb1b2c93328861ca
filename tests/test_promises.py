"""docs/reliability.md lists every promise, and each has a test that carries its number."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reliability.md"
PROMISES = range(1, 25)
ROW = re.compile(r"^\| (\d+) \| (.+?) \| (.+?) \| (.+?) \|$", re.MULTILINE)
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def rows() -> dict[int, str]:
    """Number of a promise -> its column of tests."""
    return {int(number): tests for number, _, tests, _ in ROW.findall(PAGE.read_text(encoding="utf-8"))}


def marks_of(path: Path) -> dict[str, set[int]]:
    """Test functions of a file -> the promises whose markers they carry."""
    found: dict[str, set[int]] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            found[node.name] = {
                item.args[0].value
                for item in node.decorator_list
                if isinstance(item, ast.Call) and ast.unparse(item.func) == "pytest.mark.promise"
                and isinstance(item.args[0], ast.Constant) and isinstance(item.args[0].value, int)
            }  # fmt: skip
    return found


def test_the_page_has_a_row_for_every_promise() -> None:
    assert sorted(rows()) == list(PROMISES)


def test_every_promise_names_tests_that_carry_its_number() -> None:
    for number, column in rows().items():
        named = TEST.findall(column)
        assert named, f"promise {number} names no test"
        for path, test in named:
            assert number in marks_of(ROOT / path).get(test, set()), f"{path}::{test} does not carry promise {number}"


def test_every_test_that_carries_a_number_is_on_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for test, numbers in marks_of(path).items():
            for number in numbers:
                name = f"{path.relative_to(ROOT).as_posix()}::{test}"
                assert name in rows().get(number, ""), f"{name} carries promise {number}; the page does not say so"
    assert TEST.findall(page)

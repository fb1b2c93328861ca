"""Tables that benches write into the documents, between two marks: <!-- NAME: begin --> and <!-- NAME: end -->."""

from __future__ import annotations

from pathlib import Path


def replace_between(page: Path, name: str, text: str) -> None:
    """Puts the text between the page's marks of that name. Raises ValueError if it has none."""
    old = page.read_text(encoding="utf-8")
    begin_mark, end_mark = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    begin, end = old.index(begin_mark) + len(begin_mark), old.index(end_mark)
    page.write_text(f"{old[:begin]}\n{text}\n{old[end:]}", encoding="utf-8")

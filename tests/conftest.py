"""For every test: which core is tested is said at the top; bpy is asked for only under tests/addon."""

from __future__ import annotations

import os
from typing import Any


def pytest_report_header() -> list[str]:
    from luch import core

    return [f"luch core: {core.__name__} ({os.cpu_count()} processors)"]


def pytest_collection_modifyitems(config: Any, items: list[Any]) -> None:
    """Tests with the marker `cuda` are left out where CUDA cannot be used, those with `full` where nobody asks for them."""
    if "full" not in config.getoption("-m"):
        those = [item for item in items if item.get_closest_marker("full")]
        config.hook.pytest_deselected(items=those)
        items[:] = [item for item in items if item not in those]
    marked = [item for item in items if item.get_closest_marker("cuda")]
    if not marked:  # the gate asks the architecture before anything is compiled
        return
    from luch.cuda import available

    if not available():
        config.hook.pytest_deselected(items=marked)
        items[:] = [item for item in items if item not in marked]

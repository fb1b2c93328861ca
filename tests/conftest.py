"""For every test: which core is tested is said at the top; bpy is asked for only under tests/addon."""

from __future__ import annotations

import os


def pytest_report_header() -> list[str]:
    from luch import core

    return [f"luch core: {core.__name__} ({os.cpu_count()} processors)"]

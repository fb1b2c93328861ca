"""Ctrl-C in a terminal ends a render, and the process can go on."""

from __future__ import annotations

import pytest
from support.endings import interrupt


@pytest.mark.promise(3)
def test_an_interrupt_ends_the_render_within_two_seconds_and_not_the_process() -> None:
    seconds, error, goes_on = interrupt()
    assert seconds < 2.0
    assert "interrupted" in error
    assert goes_on

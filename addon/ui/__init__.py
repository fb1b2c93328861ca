"""Panels and operators."""

from __future__ import annotations

from . import panels, stock


def register() -> None:
    panels.register()
    stock.register()


def unregister() -> None:
    stock.unregister()
    panels.unregister()

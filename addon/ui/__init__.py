"""Panels and operators."""

from __future__ import annotations

from . import operators, panels, stock


def register() -> None:
    operators.register()
    panels.register()
    stock.register()


def unregister() -> None:
    stock.unregister()
    panels.unregister()
    operators.unregister()

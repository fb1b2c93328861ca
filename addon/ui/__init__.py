"""Panels and operators."""

from __future__ import annotations

from . import datablocks, operators, panels, stock


def register() -> None:
    operators.register()
    stock.register()
    panels.register()
    datablocks.register()


def unregister() -> None:
    datablocks.unregister()
    panels.unregister()
    stock.unregister()
    operators.unregister()

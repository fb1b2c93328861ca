"""Panels and operators."""

from __future__ import annotations

from . import datablocks, effects, operators, panels, stock


def register() -> None:
    operators.register()
    stock.register()
    panels.register()
    effects.register()
    datablocks.register()


def unregister() -> None:
    datablocks.unregister()
    effects.unregister()
    panels.unregister()
    stock.unregister()
    operators.unregister()

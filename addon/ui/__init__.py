"""Panels and operators."""

from __future__ import annotations

from . import accuracy, datablocks, effects, motion, operators, panels, stock


def register() -> None:
    operators.register()
    stock.register()
    panels.register()
    accuracy.register()
    motion.register()
    effects.register()
    datablocks.register()


def unregister() -> None:
    datablocks.unregister()
    effects.unregister()
    accuracy.unregister()
    motion.unregister()
    panels.unregister()
    stock.unregister()
    operators.unregister()

"""Panels and operators."""

from __future__ import annotations

from . import accuracy, datablocks, effects, hair, motion, operators, panels, report, stock


def register() -> None:
    operators.register()
    stock.register()
    panels.register()
    accuracy.register()
    report.register()
    motion.register()
    hair.register()
    effects.register()
    datablocks.register()


def unregister() -> None:
    datablocks.unregister()
    effects.unregister()
    report.unregister()
    accuracy.unregister()
    hair.unregister()
    motion.unregister()
    panels.unregister()
    stock.unregister()
    operators.unregister()

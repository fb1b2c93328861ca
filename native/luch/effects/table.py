"""The list itself: which effects a scene needs, each with its reason in words."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

GROUPS = ("Surfaces", "Textures", "Light", "Camera", "Geometry", "Paths", "Film")
_STATE_WIDTH, _NAME_WIDTH, _LINE_WIDTH = 11, 26, 118


@dataclass(frozen=True)
class Effect:
    """One effect of one scene."""

    on: bool  # Luch simulates it in this scene
    reason: str  # why it is on or off: what in the scene says so
    cost: str = ""  # what it takes, or what its absence saves, where that is known
    missing: bool = False  # the scene asks for it and Luch cannot do it yet
    group: str = GROUPS[0]
    left_out: bool = False  # the scene needs it, the user does without

    @property
    def state(self) -> str:
        """ "on", "off", "not yet" or "left out"."""
        return "not yet" if self.missing else "left out" if self.left_out else "on" if self.on else "off"


@dataclass
class Effects:
    """Every effect that Luch knows, by name. ``print(effects)`` explains itself."""

    table: dict[str, Effect] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Effect:
        return self.table[name]

    def __contains__(self, name: object) -> bool:
        return name in self.table

    def __iter__(self) -> Iterator[str]:
        return iter(self.table)

    def add(self, group: str, name: str, on: bool, reason: str, *, cost: str = "", missing: bool = False) -> None:
        """One more effect. One that is missing is not on, whatever the scene says."""
        self.table[name] = Effect(on and not missing, reason, cost, missing, group)

    def names(self, *, on: bool) -> list[str]:
        """Of the effects that are on, or of those that are off (or missing)."""
        return [name for name, effect in self.table.items() if effect.on == on]

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Fit for JSON: name -> on, reason, group; cost where known; missing, left_out where true."""
        result: dict[str, dict[str, Any]] = {}
        for name, effect in self.table.items():
            row: dict[str, Any] = {"on": effect.on, "reason": effect.reason, "group": effect.group}
            if effect.cost:
                row["cost"] = effect.cost
            if effect.missing:
                row["missing"] = True
            if effect.left_out:
                row["left_out"] = True
            result[name] = row
        return result

    def __str__(self) -> str:
        missing = [name for name, effect in self.table.items() if effect.missing]
        counts = f"{len(self.names(on=True))} on, {len(self.names(on=False)) - len(missing)} off"
        lines = [f"Effects: {counts}" + (f", {len(missing)} not supported yet" if missing else "")]
        for group in GROUPS:
            rows = [(name, effect) for name, effect in self.table.items() if effect.group == group]
            if rows:
                lines += ["", group, *_rows(rows)]
        return "\n".join(lines)


def summary(effects: Mapping[str, Mapping[str, Any]]) -> str:
    """What is on, in one line, of ``Effects.as_dict()``: for a picture's header, where room is dear."""
    return ", ".join(name for name, row in effects.items() if row["on"])


def _rows(rows: list[tuple[str, Effect]]) -> list[str]:
    """A group's lines: what is on, what is missing, what is off; those that are off for one reason share a line."""
    lines: list[str] = []
    for state in ("on", "left out", "not yet"):
        for name, effect in rows:
            if effect.state == state:
                cost = f" ({effect.cost})" if effect.cost else ""
                lines += _line(state, name, effect.reason + cost)
    off: dict[str, list[str]] = {}
    for name, effect in rows:
        if effect.state == "off":
            off.setdefault(effect.reason, []).append(name)
    for reason, names in off.items():
        if len(names) == 1:
            lines += _line("off", names[0], reason)
        else:
            lines += _wrapped("  " + "off".ljust(_STATE_WIDTH), f"{', '.join(names)}: {reason}")
    return lines


def _line(state: str, name: str, text: str) -> list[str]:
    return _wrapped(f"  {state:{_STATE_WIDTH}}{name:{_NAME_WIDTH}}", text)


def _wrapped(head: str, text: str) -> list[str]:
    return textwrap.wrap(text, _LINE_WIDTH, initial_indent=head, subsequent_indent=" " * len(head)) or [head.rstrip()]

"""Axes of plots whose both directions are logarithms, for every canvas."""

from __future__ import annotations

import numpy as np


class LogAxis:
    """Logarithms of a range onto places from `first` on, `length` long (either may be negative)."""

    def __init__(self, low: float, high: float, first: float, length: float) -> None:
        self.low, self.high = np.log(low), np.log(max(high, 1.5 * low))
        self._first, self._length = first, length

    def at(self, value: float) -> float:
        """Values beyond the range lie at its ends."""
        share = (np.log(max(value, 1e-30)) - self.low) / (self.high - self.low)
        return self._first + float(np.clip(share, 0.0, 1.0)) * self._length

    def holds(self, value: float) -> bool:
        return value > 0.0 and bool(self.low <= np.log(value) <= self.high)

    def ticks(self) -> list[float]:
        """1, 2 and 5 times powers of ten within the range."""
        decades = range(int(np.floor(self.low / np.log(10.0))), int(np.ceil(self.high / np.log(10.0))) + 1)
        values = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
        return [value for value in values if self.low <= np.log(value) <= self.high]

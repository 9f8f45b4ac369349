"""Scales of axes: from a value to its place, with ticks that people can read."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

Tick = tuple[float, str]
"""A value and what is written beside it."""

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)

TIME_STEPS_H = (0.25, 0.5, 1, 2, 3, 6, 12, 24, 48, 96, 168, 336, 720, 2160, 8760)


@dataclass(frozen=True)
class Scale:
    """An axis from `low` to `high`; logarithmic if it says so.

    Parameters
    ----------
    divisor
        What is written is the value over this: 1e9 for N/m in GN/m.
    """

    low: float
    high: float
    is_log: bool = False
    divisor: float = 1.0

    def at(self, value: float) -> float:
        """Place of a value, 0 to 1 inside."""
        if self.is_log:
            value = max(value, 1e-300)
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self, most: int = 6) -> Sequence[Tick]:
        """Round values."""
        return self._decades() if self.is_log else self._linear(most)

    def _linear(self, most: int) -> list[Tick]:
        low, high = self.low / self.divisor, self.high / self.divisor
        power = 10.0 ** math.floor(math.log10((high - low) / most))
        step = next(s * power for s in STEPS if (high - low) / (s * power) <= most)
        first = math.ceil(low / step - 1e-9)
        values = [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]
        return [(value * self.divisor, f"{value:.10g}") for value in values]

    def _decades(self) -> list[Tick]:
        first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
        return [(10.0**n, f"{10.0**n:g}") for n in range(first, last + 1)]


@dataclass(frozen=True)
class TimeScale:
    """An axis of time, seconds since 1970 UTC."""

    low: float
    high: float

    def at(self, value: float) -> float:
        """Place of a value, 0 to 1 inside."""
        return (value - self.low) / (self.high - self.low)

    def ticks(self, most: int = 8) -> Sequence[Tick]:
        """Round hours and days."""
        span_h = (self.high - self.low) / 3600.0
        step_s = 3600.0 * next((s for s in TIME_STEPS_H if span_h / s <= most), TIME_STEPS_H[-1])
        first = math.ceil(self.low / step_s)
        times = [i * step_s for i in range(first, math.floor(self.high / step_s) + 1)]
        pattern = "%d %b" if step_s >= 86_400.0 else "%d %b %H:%M"
        return [(t, datetime.fromtimestamp(t, UTC).strftime(pattern)) for t in times]


def around(values: Iterable[float | None], margin: float = 0.06) -> tuple[float, float] | None:
    """Lowest and highest of values with some room; None if there are none."""
    found = [value for value in values if value is not None and math.isfinite(value)]
    if not found:
        return None
    low, high = min(found), max(found)
    room = margin * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room

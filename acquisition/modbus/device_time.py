"""Time of measurement in the registers of a device, by the device's own clock."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TypeAlias

from acquisition.modbus.cells import Cell
from core.units import ns_from_s

CALENDAR_FIELDS = ("year", "month", "day", "hour", "minute", "second")
_CENTURY = 2000

_LATEST_S = 2.0**33
"""Latest valid device time (year 2242), s since 1970; int64 nanoseconds since 1970 end in 2262."""


@dataclass(frozen=True, kw_only=True)
class EpochTime:
    """Device time as seconds since 1970, with an optional cell for the fraction of a second.

    Parameters
    ----------
    parts
        Cell of the fraction; None if the device has whole seconds only.
    parts_per_s
        Units of the fraction per second; example: 1e6 for microseconds.
    """

    seconds: Cell
    parts: Cell | None = None
    parts_per_s: float = 1e6

    @property
    def resolution_s(self) -> float:
        """Resolution of the device time, s."""
        return 1.0 if self.parts is None else 1.0 / self.parts_per_s

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that hold the time."""
        yield self.seconds
        if self.parts is not None:
            yield self.parts

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """Return UTC in ns since 1970 from the numbers of `cells`; None for an invalid time."""
        if not all(map(math.isfinite, numbers)) or numbers[0] <= 0.0:
            return None
        parts = numbers[1] / self.parts_per_s if self.parts is not None else 0.0
        if not 0.0 < numbers[0] + parts < _LATEST_S or abs(parts) > _LATEST_S:
            return None
        return ns_from_s(numbers[0]) + ns_from_s(parts)


@dataclass(frozen=True, kw_only=True)
class CalendarTime:
    """Device time as date and time of day in six consecutive registers.

    Parameters
    ----------
    first
        Cell of the first of the six registers.
    fields
        "year", "month", "day", "hour", "minute" and "second" in the order of the registers. A
        year below 100 belongs to the current century (2000 to 2099).
    utc_offset_s
        Device clock minus UTC, s.
    """

    first: Cell
    fields: tuple[str, ...] = CALENDAR_FIELDS
    utc_offset_s: float = 0.0

    @property
    def resolution_s(self) -> float:
        """Resolution of the device time, s."""
        return 1.0

    def cells(self) -> Iterator[Cell]:
        """Yield the cells that hold the time."""
        for n in range(len(self.fields)):
            yield Cell(
                address=self.first.address + n,
                function=self.first.function,
                byte_order=self.first.byte_order,
            )

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """Return UTC in ns since 1970 from the numbers of `cells`; None for an invalid time."""
        part = dict(zip(self.fields, map(int, numbers), strict=True))
        part["year"] += _CENTURY if part["year"] < 100 else 0
        try:
            moment = datetime(**part, tzinfo=UTC)
        except ValueError:
            return None
        if moment.timestamp() > _LATEST_S:
            return None
        return ns_from_s(moment.timestamp()) - ns_from_s(self.utc_offset_s)


DeviceTime: TypeAlias = EpochTime | CalendarTime

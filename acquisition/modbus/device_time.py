"""The time at which a device measured, by its own clock."""

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
"""In the year 2242: nanoseconds since 1970 have 63 bits, and what lies beyond is no time."""


@dataclass(frozen=True, kw_only=True)
class EpochTime:
    """Seconds since 1970, and perhaps parts of a second.

    Parameters
    ----------
    parts
        Where these stand.
    parts_per_s
        Example: 1e6 for microseconds.
    """

    seconds: Cell
    parts: Cell | None = None
    parts_per_s: float = 1e6

    @property
    def resolution_s(self) -> float:
        """Least difference of two times."""
        return 1.0 if self.parts is None else 1.0 / self.parts_per_s

    def cells(self) -> Iterator[Cell]:
        """All that has to be read."""
        yield self.seconds
        if self.parts is not None:
            yield self.parts

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """UTC, from the numbers of its cells; None if there is no such time."""
        if not all(map(math.isfinite, numbers)) or numbers[0] <= 0.0:
            return None
        parts = numbers[1] / self.parts_per_s if self.parts is not None else 0.0
        if not 0.0 < numbers[0] + parts < _LATEST_S or abs(parts) > _LATEST_S:
            return None
        return ns_from_s(numbers[0]) + ns_from_s(parts)


@dataclass(frozen=True, kw_only=True)
class CalendarTime:
    """Six registers with the parts of a date and time, in any order.

    Parameters
    ----------
    first
        The first of the six.
    fields
        "year", "month", "day", "hour", "minute" and "second" as they follow each other. A year
        below 100 is of this century.
    utc_offset_s
        What the device's clock is ahead of UTC.
    """

    first: Cell
    fields: tuple[str, ...] = CALENDAR_FIELDS
    utc_offset_s: float = 0.0

    @property
    def resolution_s(self) -> float:
        """Least difference of two times."""
        return 1.0

    def cells(self) -> Iterator[Cell]:
        """All that has to be read."""
        for n in range(len(self.fields)):
            yield Cell(
                address=self.first.address + n,
                function=self.first.function,
                byte_order=self.first.byte_order,
            )

    def time_ns(self, numbers: Sequence[float]) -> int | None:
        """UTC, from the numbers of its cells; None if there is no such time."""
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

"""Errors, queries and query results of the store."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from core.alarms.alarm import AlarmEvent
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.quality import Level, Reading
from core.samples.gaps import Gap


class StoreError(Exception):
    """Error raised if the database cannot be used; the message states cause and remedy."""


class RefusedRowError(StoreError):
    """Error raised if a row violates a constraint or its page is damaged; a retry is useless."""


class QueryTooLargeError(Exception):
    """Error raised if a query needs more data than the limit, which the message states."""


@dataclass(frozen=True)
class ValueRange:
    """Range of values with inclusive lower and upper bounds; None for no bound."""

    low: float | None = None
    high: float | None = None

    def includes(self, value: float | None) -> bool:
        """Return whether a value is known and within the bounds."""
        low, high = self.low, self.high
        return value is not None and not (
            (low is not None and value < low) or (high is not None and value > high)
        )


@dataclass(frozen=True)
class UnitGap:
    """Gap in the samples of a unit, with the id of the unit."""

    unit: str
    gap: Gap


@dataclass(frozen=True)
class TrendQuery:
    """Query for trends of one bearing.

    Parameters
    ----------
    eccentricity_ratio, oil_temperature_c
        Ranges of the operating condition; readings outside or without the value are left out.
    start_ns, end_ns
        Half-open time range, ns since 1970 UTC.
    max_points
        Maximum number of points; more readings are aggregated into buckets of equal width.
    hole_ns
        Maximum interval between consecutive readings, ns; a longer interval is a hole in the trend.
    states
        Operating states to include; empty for all.
    is_page
        Whether to return at most ``max_points`` single readings, oldest first, and the start time
        of the next page, instead of buckets.
    """

    unit: str
    bearing: str
    quantities: tuple[str, ...]
    start_ns: int
    end_ns: int
    max_points: int
    hole_ns: int
    eccentricity_ratio: ValueRange = field(default_factory=ValueRange)
    oil_temperature_c: ValueRange = field(default_factory=ValueRange)
    states: tuple[OperatingState, ...] = ()
    is_page: bool = False


@dataclass(frozen=True)
class TrendSeries:
    """Statistics of one quantity, one item per bucket; None without a usable reading.

    `count` is the number of usable readings; `worst_level` is the worst quality of the readings.
    """

    minimum: Sequence[float | None]
    maximum: Sequence[float | None]
    mean: Sequence[float | None]
    count: Sequence[int]
    worst_level: Sequence[Level | None]


@dataclass(frozen=True)
class Trend:
    """Trends of one bearing.

    Parameters
    ----------
    bucket_ns
        Width of the buckets; None for single readings.
    time_ns
        Start times of the buckets, or times of the single readings, in ns since 1970 UTC.
    series
        Statistics of the readings by quantity.
    next_ns
        Time of the first reading of the next page; None on the last page.
    coarse_until_ns
        Time up to which single readings were deleted; None if the range begins later.
    """

    bucket_ns: int | None
    time_ns: Sequence[int]
    series: Mapping[str, TrendSeries]
    next_ns: int | None = None
    coarse_until_ns: int | None = None


@dataclass(frozen=True)
class StoredReadings:
    """Stored readings of one bearing at one time, ns since 1970 UTC, by quantity."""

    time_ns: int
    readings: Mapping[str, Reading]


@dataclass(frozen=True)
class AlarmQuery:
    """Query for alarm events, newest first; None for a field matches all.

    Operating states and value ranges refer to the operating point at which the alarm was raised.

    Parameters
    ----------
    before
        Event number; only events with lower numbers are returned.
    limit
        Maximum number of events.
    start_ns, end_ns
        Half-open time range, ns since 1970 UTC.
    states
        Operating states to include; empty for all.
    """

    before: int = 2**63 - 1
    limit: int = 100
    alarm: str | None = None
    unit: str | None = None
    subject: str | None = None
    kind: str | None = None
    level: AlarmLevel | None = None
    start_ns: int = 0
    end_ns: int = 2**63 - 1
    states: tuple[OperatingState, ...] = ()
    eccentricity_ratio: ValueRange = field(default_factory=ValueRange)
    oil_temperature_c: ValueRange = field(default_factory=ValueRange)
    attitude_deg: ValueRange = field(default_factory=ValueRange)


@dataclass(frozen=True)
class StoredEvent:
    """Alarm event with its number in the store; later events have higher numbers."""

    id: int
    event: AlarmEvent

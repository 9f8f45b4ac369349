"""Errors of the store, and the queries and results that its callers share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from core.alarms.alarm import AlarmEvent
from core.condition.operating_state import OperatingState
from core.quality import Level, Reading
from core.samples.gaps import Gap


class StoreError(Exception):
    """The database cannot be used; the message says why and what to do."""


class RefusedRowError(StoreError):
    """The database permanently rejects a row: it violates a constraint, or its page is damaged."""


class QueryTooLargeError(Exception):
    """A query exceeds the amount of data that one call returns; the message says by how much."""


@dataclass(frozen=True)
class ValueRange:
    """Inclusive bounds of a value; None leaves a side open."""

    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class UnitGap:
    """Gap in the samples of one unit."""

    unit: str
    gap: Gap


@dataclass(frozen=True)
class TrendQuery:
    """Query for trends of one bearing.

    Parameters
    ----------
    start_ns, end_ns
        Half-open time range.
    max_points
        Readings beyond this number are aggregated into buckets of equal width.
    hole_ns
        Readings further apart than this are separated by a hole.
    states
        Operating states; empty for all.
    is_page
        Return single readings, oldest first; those beyond ``max_points`` belong to the next page.
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
    """One quantity, a value for each bucket; None where no reading was usable."""

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
        Width of the buckets, whose time is their start; None for single readings.
    next_ns
        Time of the first reading of the next page; None on the last page.
    coarse_until_ns
        End of the time for which only buckets are stored; None if the range begins after it.
    """

    bucket_ns: int | None
    time_ns: Sequence[int]
    series: Mapping[str, TrendSeries]
    next_ns: int | None = None
    coarse_until_ns: int | None = None


@dataclass(frozen=True)
class StoredReadings:
    """Readings of one bearing at one time, by the quantities that were stored then."""

    time_ns: int
    readings: Mapping[str, Reading]


@dataclass(frozen=True)
class AlarmQuery:
    """Query for events of alarms, newest first; None matches everything.

    The operating condition is that under which the occurrence was raised.

    Parameters
    ----------
    before
        Only events with lower numbers.
    limit
        Maximum number of events.
    start_ns, end_ns
        Half-open time range.
    states
        Operating states; empty for all.
    """

    before: int = 2**63 - 1
    limit: int = 100
    alarm: str | None = None
    unit: str | None = None
    kind: str | None = None
    start_ns: int = 0
    end_ns: int = 2**63 - 1
    states: tuple[OperatingState, ...] = ()
    eccentricity_ratio: ValueRange = field(default_factory=ValueRange)
    oil_temperature_c: ValueRange = field(default_factory=ValueRange)
    attitude_deg: ValueRange = field(default_factory=ValueRange)


@dataclass(frozen=True)
class StoredEvent:
    """Event of an alarm with its number in the store; numbers increase."""

    id: int
    event: AlarmEvent

"""The store as the rest of the service sees it, and what it hands out."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from core.alarms.alarm import Alarm, AlarmEvent, AlarmNews
from core.change.film_judge import FilmNews
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import Level, Reading
from core.samples.gaps import Gap, Reach
from service.store.access.port import AccessStore
from service.store.audit_port import AuditStore
from service.store.database import Hold
from service.store.film_port import FilmStore
from service.store.gap_reference import GapReference
from service.store.integrity_port import Integrity
from service.store.outbox import Outbox
from service.store.retention.port import RetentionStore
from service.store.rollups.port import RollupStore
from service.store.sharing import Commands, StreamPosition, UnitStates
from service.store.spectra_port import SpectraStore
from service.store.value_range import ValueRange
from service.store.vector_reference_port import VectorReferenceStore
from service.store.waveform_port import WaveformStore


class StoreError(Exception):
    """The store cannot be used: another program's, newer than this one, or damaged."""


class RefusedRowError(StoreError):
    """A row breaks a rule of the database, or its page is damaged: it can never be written."""


@dataclass(frozen=True)
class UnitGap:
    """A gap in the samples of one unit, to be recorded."""

    unit: str
    gap: Gap


@dataclass(frozen=True)
class TrendQuery:
    """Which trends of one bearing are wanted.

    Parameters
    ----------
    start_ns, end_ns
        From the first, up to but not including the second.
    max_points
        More readings than this are gathered into buckets of equal width.
    hole_ns
        Neighbouring readings further apart than this have a hole between them.
    states
        Only readings in these operating states; empty for all.
    is_page
        Whether readings stay alone, oldest first, and those beyond ``max_points`` wait for the next
        page.
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
        Width of the buckets, whose time is their start; None if every reading stands alone.
    next_ns
        Time of the first reading of the next page; None if there is none.
    coarse_until_ns
        Up to when single readings are gone, where the range begins before; only buckets tell of
        that time.
    """

    bucket_ns: int | None
    time_ns: Sequence[int]
    series: Mapping[str, TrendSeries]
    next_ns: int | None = None
    coarse_until_ns: int | None = None


@dataclass(frozen=True)
class StoredReadings:
    """Readings of one bearing at one time; those of quantities that it was stored with."""

    time_ns: int
    readings: Mapping[str, Reading]


@dataclass(frozen=True)
class AlarmQuery:
    """Which events of alarms are wanted, newest first; None where anything will do.

    Events of an occurrence are found by the operating condition under which it was raised.

    Parameters
    ----------
    before
        Only events that were stored before this one.
    limit
        Most events that are read.
    start_ns, end_ns
        From the first, up to but not including the second.
    states
        Only of occurrences raised in these operating states; empty for all.
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
    """An event of an alarm with the number that the store gave it; later ones have higher ones."""

    id: int
    event: AlarmEvent


class Store(Protocol):
    """Durable results. What `append` has returned from is on the disk."""

    @property
    def outbox(self) -> Outbox:
        """What is to be told to receivers, queued as events of alarms are appended."""
        ...

    @property
    def films(self) -> FilmStore:
        """Readings and baselines of films."""
        ...

    @property
    def spectra(self) -> SpectraStore:
        """Spectra over time, kept as assessments are appended."""
        ...

    @property
    def audit(self) -> AuditStore:
        """Who did what to what."""
        ...

    @property
    def rollups(self) -> RollupStore:
        """Trends gathered beforehand."""
        ...

    @property
    def retention(self) -> RetentionStore:
        """Deletes what is old."""
        ...

    @property
    def order1_references(self) -> VectorReferenceStore:
        """Where 1× vectors were when all was well."""
        ...

    @property
    def waveforms(self) -> WaveformStore:
        """Which recordings there are, and in which state."""
        ...

    @property
    def integrity(self) -> Integrity:
        """Whether what is stored is what was stored."""
        ...

    @property
    def access(self) -> AccessStore:
        """Who may come in: accounts, sessions, keys."""
        ...

    @property
    def kind(self) -> str:
        """``sqlite`` or ``postgresql``: the database that it is in."""
        ...

    @property
    def unit_states(self) -> UnitStates:
        """What processes that analyse say of their units."""
        ...

    @property
    def commands(self) -> Commands:
        """What operators ask of them."""
        ...

    def append(
        self,
        assessments: Sequence[Assessment],
        gaps: Sequence[UnitGap],
        alarms: Sequence[AlarmNews] = (),
        films: Sequence[FilmNews] = (),
        positions: Sequence[StreamPosition] = (),
    ) -> None:
        """Write all or nothing; what is written twice counts once.

        Parameters
        ----------
        positions
            How far the results of units reach on a stream, with these.
        """
        ...

    def trend(self, query: TrendQuery) -> Trend:
        """Read trends. Raises `QueryTooLargeError` where memory or time could run out."""
        ...

    def gaps(self, unit: str, start_ns: int, end_ns: int) -> Sequence[Gap]:
        """Read the recorded gaps whose end lies in a range of time, oldest first.

        Raises
        ------
        QueryTooLargeError
            If they are too many.
        """
        ...

    def reach(self, unit: str) -> Reach | None:
        """Read up to where the stored results of a unit reach; None if there are none."""
        ...

    def newest(self, unit: str, bearing: str) -> StoredReadings | None:
        """Read the newest readings of a bearing; None if there are none."""
        ...

    def add_reference(self, reference: GapReference) -> None:
        """Write a reference, which rules its bearing from now on; older ones are kept."""
        ...

    def references(self) -> Sequence[GapReference]:
        """Read the reference that was set last for each bearing that has one."""
        ...

    def reference_history(self, unit: str, bearing: str) -> Sequence[GapReference]:
        """Read what was ever set for a bearing, newest first; at most the newest thousand."""
        ...

    def position(self, unit: str) -> StreamPosition | None:
        """How far the results of a unit reach on a stream; None if they never came from one."""
        ...

    def alarms(self) -> Sequence[Alarm]:
        """Read every alarm that ever had an event, as it was after its newest."""
        ...

    def alarm_events(self, query: AlarmQuery) -> Sequence[StoredEvent]:
        """Read events of alarms, newest first."""
        ...

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Take a name among all processes that use the database; see `Database.hold`."""
        ...

    def close(self) -> None:
        """Release the files; closing twice is fine."""
        ...


class QueryTooLargeError(Exception):
    """A query would read more than the store hands out at once; the message says how much."""

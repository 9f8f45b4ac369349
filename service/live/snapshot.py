"""Snapshots of units and of the measuring process, and their encoding as documents."""

import pickle
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version

from pydantic import ConfigDict, TypeAdapter, ValidationError

from core.alarms.alarm import Alarm
from core.change.film_judge import FilmNews
from core.monitor.assessment import BearingResult
from core.uncertainty import Budget
from service.live.receivers import ReceiverView
from service.live.status import StoredResults, UnitStatus
from service.runtime.polls import PollStatistics

OWN_VERSION = version("padwatch").encode() + b"\n"

MAX_BYTES = 16_000_000
"""Maximum size in bytes of a decompressed document, many times that of the largest unit."""


class UnreadableError(Exception):
    """Error raised if a document is damaged, or from another version of the program."""


def content_of(document: bytes, what: str) -> bytes:
    """Return the content of a document, which begins with `OWN_VERSION`; `what` is its kind.

    Raises `UnreadableError` if the document is from another version of the program.
    """
    theirs, _, content = document.partition(b"\n")
    if theirs != OWN_VERSION.rstrip():
        raise UnreadableError(
            f"the {what} was written by padwatch {theirs[:40].decode('ascii', 'replace')}, but"
            f" this is padwatch {version('padwatch')}; update all processes to one version"
        )
    return content


class PickledBudgets(Mapping[str, Budget]):
    """Uncertainty budgets by quantity, pickled, and unpickled at the first access.

    They are a third of a snapshot, and hardly ever read.
    """

    def __init__(self, budgets: Mapping[str, Budget]) -> None:
        self._pickled = pickle.dumps(budgets, pickle.HIGHEST_PROTOCOL)

    @cached_property
    def _budgets(self) -> Mapping[str, Budget]:
        budgets: Mapping[str, Budget] = pickle.loads(self._pickled)  # noqa: S301  our own
        return budgets

    def __getitem__(self, quantity: str) -> Budget:
        return self._budgets[quantity]

    def __iter__(self) -> Iterator[str]:
        return iter(self._budgets)

    def __len__(self) -> int:
        return len(self._budgets)


@dataclass(frozen=True)
class UnitSnapshot:
    """State of a unit that changes with each result.

    Parameters
    ----------
    bearings, films
        Newest results of the bearings and newest readings of their films, by bearing id.
    alarms
        All alarms of the unit.
    judged, chattering
        Ids of the alarms whose condition is now known, and of the chattering alarms.
    baselines
        Baseline version in force, by bearing id.
    """

    bearings: Mapping[str, BearingResult]
    alarms: tuple[Alarm, ...]
    judged: frozenset[str]
    chattering: frozenset[str]
    films: Mapping[str, FilmNews]
    baselines: Mapping[str, int]

    def __reduce__(self) -> tuple[object, ...]:
        bearings = {
            bearing: replace(result, budgets=PickledBudgets(result.budgets))
            for bearing, result in self.bearings.items()
        }
        return type(self), tuple({**vars(self), "bearings": bearings}.values())


@dataclass(frozen=True)
class UnitLink:
    """Part of a unit's state that changes continuously: link, and age of samples and results.

    Parameters
    ----------
    data_age_s
        Age of the newest samples in seconds; None before the first.
    result_ages_s
        Age of the newest result in seconds, by bearing id.
    said_s
        Monotonic time of the process at which the state was published, s.
    store_error
        Present error of the database in the process that analyses the unit, or None.
    stored
        Results of the unit that this process has stored.
    """

    status: UnitStatus
    data_age_s: float | None
    result_ages_s: Mapping[str, float]
    said_s: float
    store_error: str | None = None
    stored: StoredResults = field(default_factory=StoredResults)


@dataclass(frozen=True)
class UnitReport:
    """Report of a measuring process on one unit.

    Parameters
    ----------
    unit
        Id of the unit; `PLANT` or `SHARED` for alarms that belong to no unit.
    revision
        Revision number of the snapshot, increased with each change.
    snapshot
        Snapshot of the unit; None if it has not changed since the previous report.
    """

    unit: str
    link: UnitLink
    revision: int
    snapshot: UnitSnapshot | None


@dataclass(frozen=True)
class Report:
    """Report of a measuring process at one time; `number` counts its reports.

    Parameters
    ----------
    process
        Identifier of the process, which changes with each start.
    units
        Reports on units; units without changes may be missing.
    plant
        State of the process; None if it has not changed.
    """

    process: str
    number: int
    units: tuple[UnitReport, ...]
    plant: "PlantSnapshot | None"


@dataclass(frozen=True)
class SourceCounts:
    """Counts of a unit's data source since the start.

    `polls` is None without polls; `refused_frames` are the numbers of refused frames, by reason.
    """

    polls: PollStatistics | None = None
    refused_frames: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class CaptureStatus:
    """State of the recordings around alarms.

    Parameters
    ----------
    trouble
        Reason why samples cannot be recorded now, or None.
    error
        Reason why the newest recording failed, or None.
    being_made
        Alarm id and occurrence number of each recording in progress.
    """

    trouble: str | None = None
    error: str | None = None
    being_made: frozenset[tuple[str, int]] = frozenset()


@dataclass(frozen=True)
class EvidenceStatus:
    """State of the collection of evidence about alarms.

    Both fields contain pairs of alarm id and occurrence number: `pending` of the bundles that are
    still to be written, `capturing` of the recordings that are not linked to their bundle yet.
    """

    pending: frozenset[tuple[str, int]] = frozenset()
    capturing: frozenset[tuple[str, int]] = frozenset()


@dataclass(frozen=True)
class PlantSnapshot:
    """State of the measuring process itself.

    Parameters
    ----------
    loops
        Fault of each background loop by name; None for a working loop.
    checks
        Results, as text by name, of health checks that do not affect readiness.
    audit_error
        Error of the last attempt to write the head file of the audit trail, or None.
    evidence
        State of the evidence of alarms; None if no evidence is collected.
    continuous
        Ids of the units whose samples are recorded continuously.
    continuous_trouble
        Reason why continuous recording is interrupted, or None.
    faults
        Fault of each damaged recording, by name of the recording.
    receivers
        Receivers of notifications in the plant file.
    sources
        Counts of each unit's data source, by unit id.
    """

    loops: Mapping[str, str | None] = field(default_factory=dict)
    checks: Mapping[str, str] = field(default_factory=dict)
    audit_error: str | None = None
    captures: CaptureStatus = CaptureStatus()
    evidence: EvidenceStatus | None = None
    continuous: tuple[str, ...] = ()
    continuous_trouble: str | None = None
    faults: Mapping[str, str] = field(default_factory=dict)
    receivers: tuple[ReceiverView, ...] = ()
    sources: Mapping[str, SourceCounts] = field(default_factory=dict)


# wrapped in a tuple, so that the NaN setting applies to all nested values
_WITH_NAN = ConfigDict(ser_json_inf_nan="constants")
_SNAPSHOT = TypeAdapter(tuple[UnitSnapshot], config=_WITH_NAN)
_SIGNS = TypeAdapter(tuple[UnitLink], config=_WITH_NAN)


def snapshot_document(snapshot: UnitSnapshot) -> bytes:
    """Return the snapshot as the version of the program, a line feed, and compressed JSON."""
    return OWN_VERSION + zlib.compress(_SNAPSHOT.dump_json((snapshot,)), level=1)


def snapshot_of_document(document: bytes) -> UnitSnapshot:
    """Return the snapshot in a document that `snapshot_document` returned.

    Raises `UnreadableError` if the document is damaged, or from another version of the program.
    """
    compressed, unpacker = content_of(document, "snapshot"), zlib.decompressobj()
    try:
        content = unpacker.decompress(compressed, MAX_BYTES)
        if unpacker.unconsumed_tail or not unpacker.eof:
            words = f"the snapshot of a unit is truncated or longer than {MAX_BYTES} bytes"
            raise UnreadableError(words)
        return _SNAPSHOT.validate_json(content)[0]
    except (zlib.error, ValidationError) as error:
        raise UnreadableError(f"the snapshot of a unit cannot be read: {error}") from error


def link_document(signs: UnitLink) -> str:
    """Return the continuously changing state of a unit as a JSON document."""
    return _SIGNS.dump_json((signs,)).decode()


def link_of_document(document: str) -> UnitLink:
    """Parse a document of `link_document`; raise `UnreadableError` if it is damaged."""
    try:
        return _SIGNS.validate_json(document)[0]
    except ValidationError as error:
        raise UnreadableError(f"the link of a unit cannot be read: {error}") from error

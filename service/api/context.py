"""Interfaces of the API to the running service, collected in `Context`."""

import pathlib
from collections.abc import Awaitable, Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Annotated, Protocol

from fastapi import Path
from prometheus_client.registry import Collector

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from core.alarms.judgements import VectorReference
from core.alarms.operation import Action
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.monitor.assessment import Assessment
from core.quality import Reason
from core.samples.blocks import SampleBlock
from service.api.auth.authenticator import Authenticator
from service.api.auth.refusals import Refusals
from service.api.downloads import Downloads
from service.api.load import LoadWatch
from service.api.problems import ProblemError
from service.live.alarm_list import AlarmList, EvidenceStatus
from service.live.commands import BaselineAction, FilmPlace
from service.live.live_view import CurrentBearing, UnitStatus
from service.measuring.references import ReferencesInForce
from service.notifications.sender import ReceiverView
from service.recordings.continuous_recorder import ContinuousRecorder
from service.runtime.disk import SpaceWatch
from service.runtime.polls import TimedSource
from service.settings.bearings import BearingSettings
from service.settings.configuration import Configuration
from service.settings.films import FilmAlarmSettings
from service.settings.storage import Origin
from service.settings.units import UnitSettings
from service.store.store import Store


class LiveState(Protocol):
    """Newest samples and results of all units; see :class:`service.live.live_view.LiveView`."""

    @property
    def revision(self) -> int:
        """Number that changes with every change of a link state and every result."""

    @property
    def store_error(self) -> str | None:
        """Reason why results cannot be stored or read; None without a fault."""

    @property
    def n_unstored(self) -> int:
        """Number of results and events that are missing in the database."""

    def status(self, unit: str) -> UnitStatus:
        """Return the status of the data source of a unit."""

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Return the buffered blocks of a unit, oldest first; replicas raise NotAvailableError."""

    def newest_block(self, unit: str) -> SampleBlock | None:
        """Return the newest sample block of a unit; None without a block."""

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return the reason why the samples of a unit are not current; None if they are current."""

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest sample block of a unit, s; None without a block."""

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return the newest result with spectrum and orbit; None before the first result.

        Replicas raise `NotAvailableError`, since they have no spectra and orbits.
        """

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result of a bearing; its readings have no values if it is outdated."""


class FilmState(Protocol):
    """State of the oil films of all bearings; see :class:`service.measuring.films.FilmMonitor`."""

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Reason why the films of a unit are not watched, by identifier of the unit."""

    @property
    def settings(self) -> FilmAlarmSettings:
        """Settings of film monitoring."""

    def rules(self, unit: str) -> FilmRules | None:
        """Return the rules for judging the films of a unit; None if its films are not watched."""

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """Return unit, bearing and estimator of a film; None if the film is not watched."""

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest reading of a film with its findings; None without a reading."""

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force of a bearing; None if no baseline is in force."""


class CaptureStatus(Protocol):
    """State of recordings around alarms; see :class:`service.recordings.around_alarms.Captures`."""

    @property
    def error(self) -> str | None:
        """Reason why the newest recording failed; None if it succeeded."""

    @property
    def trouble(self) -> str | None:
        """Reason why samples cannot be recorded now; None if recording is possible."""

    @property
    def n_running(self) -> int:
        """Number of recordings in progress."""

    @property
    def n_written(self) -> int:
        """Number of recordings finished since the service started."""

    @property
    def being_made(self) -> Set[tuple[str, int]]:
        """Alarm identifier and occurrence number of each recording in progress."""


class OperationService(Protocol):
    """Executor of operations on alarms and baselines, in the process that analyses the unit."""

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Execute an operation on an alarm; return the stored alarm.

        Raises
        ------
        LookupError
            If the alarm does not exist.
        ActionRefusedError
            If the operation does not fit the state of the alarm.
        CommandFailedError
            If no process executes the operation, or the disk does not answer.
        """

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Execute an action on the baselines of a bearing, and wait until it is stored.

        Raises
        ------
        BaselineRefusedError
            If the action does not fit the baselines.
        CommandFailedError
            If no process executes the action.
        """

    async def refer_to(self, reference: VectorReference) -> None:
        """Apply a newly stored 1× reference in the comparison of vibration vectors."""


UnitId = Annotated[str, Path(description="Identifier of a unit.", examples=["U1"])]
BearingId = Annotated[str, Path(description="Identifier of a bearing.", examples=["UJB"])]
QuantityName = Annotated[
    str, Path(description="Name from the catalogue.", examples=["dynamic_k_xx_n_per_m"])
]


@dataclass(frozen=True)
class Context:
    """Parts of the running service that the API uses.

    Parameters
    ----------
    units
        Settings of all units, by identifier of the unit.
    refresh_s
        Time between successive results, s.
    max_shelf_s
        Maximum duration of shelving an alarm, s.
    receivers
        Function that returns the state of all receivers of alarm messages.
    evidence
        Function that returns the state of the alarm evidence; None without evidence.
    configuration
        Plant file without secrets; None if the configuration is not kept.
    metrics
        Function that collects the metrics for Prometheus; None without metrics.
    loops
        Function that returns the fault of each background loop, by name; None without a fault.
    stored_trouble
        Function that returns a description of damaged stored data; None without damage.
    checks
        Function that returns results of further health checks, by name, which do not affect
        readiness.
    access
        Authenticator; if None, local callers can read without a login.
    space
        Monitor of free disk space; None without a monitor.
    load
        Load monitor; None if requests are never refused under load.
    tape
        Continuous recorder; None if this process does not record.
    recordings
        Folders of recordings, the first for recordings around alarms; None without recordings.
    faults
        Function that returns the fault of each damaged recording, by name of the recording.
    refusals
        Writer of audit entries for refused requests; if None, the application creates it.
    sources
        Data sources with statistics of their polls, by identifier of the unit.
    """

    plant_name: str
    units: Mapping[str, UnitSettings]
    live: LiveState
    store: Store
    clock: Clock
    refresh_s: float
    references: ReferencesInForce
    alarms: AlarmList
    films: FilmState
    operators: OperationService
    captures: CaptureStatus
    receivers: Callable[[], Awaitable[Sequence[ReceiverView]]]
    origin: Origin = Origin.LIVE
    max_shelf_s: float = 86_400.0
    evidence: Callable[[], EvidenceStatus] | None = None
    configuration: Configuration | None = None
    downloads: Downloads = field(default_factory=Downloads)
    metrics: Callable[[], Awaitable[Collector]] | None = None
    loops: Callable[[], Mapping[str, str | None]] = dict
    checks: Callable[[], Mapping[str, str]] = dict
    stored_trouble: Callable[[], str | None] = lambda: None
    refusals: Refusals | None = None
    sources: Mapping[str, TimedSource] = field(default_factory=dict)
    access: Authenticator | None = None
    space: SpaceWatch | None = None
    load: LoadWatch | None = None
    tape: ContinuousRecorder | None = None
    recordings: Sequence[pathlib.Path] | None = None
    faults: Callable[[], Mapping[str, str]] = dict

    def unit(self, unit: str) -> UnitSettings:
        """Return the settings of a unit; raise a problem of status 404 for an unknown unit."""
        if unit not in self.units:
            raise ProblemError(404, "Unknown unit", f"there is no unit {unit!r} in this plant")
        return self.units[unit]

    def bearing(self, unit: str, bearing: str) -> BearingSettings:
        """Return the settings of a bearing; raise a problem of status 404 if it is unknown."""
        for settings in self.unit(unit).bearing:
            if settings.id == bearing:
                return settings
        raise ProblemError(404, "Unknown bearing", f"unit {unit!r} has no bearing {bearing!r}")

"""Parts of the running service that routes use."""

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
    """Live state; see :class:`service.live.live_view.LiveView`."""

    @property
    def revision(self) -> int:
        """Number that changes with every link change and result."""

    @property
    def store_error(self) -> str | None:
        """Why results are not stored or read; None if they are."""

    @property
    def n_unstored(self) -> int:
        """Number of dropped findings."""

    def status(self, unit: str) -> UnitStatus:
        """Return the state of the source of a unit."""

    def blocks(self, unit: str) -> Sequence[SampleBlock]:
        """Return the newest blocks of a unit; raise `NotAvailableError` if there are none."""

    def newest_block(self, unit: str) -> SampleBlock | None:
        """Return the newest block of a unit; None without one."""

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return why the newest samples of a unit are not current; None if they are."""

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest block; None without one."""

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return the newest result with spectrum and orbit; raise as `blocks` does."""

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result; values that are not current are missing."""


class FilmState(Protocol):
    """The films of all bearings; see :class:`service.measuring.films.FilmMonitor`."""

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Why films are not watched, by unit."""

    @property
    def settings(self) -> FilmAlarmSettings:
        """Settings of film monitoring."""

    def rules(self, unit: str) -> FilmRules | None:
        """Return the film rules of a unit; None if its films are not watched."""

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """Return a bearing with its estimator; None if it is not watched."""

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """Return the newest findings of a bearing."""

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """Return the baseline in force of a bearing."""


class CaptureStatus(Protocol):
    """Samples around alarms; see :class:`service.recordings.around_alarms.Captures`."""

    @property
    def error(self) -> str | None:
        """Why the newest recording failed; None if it did not."""

    @property
    def trouble(self) -> str | None:
        """Why samples are not recorded now."""

    @property
    def n_running(self) -> int:
        """Number of recordings in progress."""

    @property
    def n_written(self) -> int:
        """Number of recordings finished since the start."""

    @property
    def being_made(self) -> Set[tuple[str, int]]:
        """Alarms and occurrences of the recordings in progress."""


class OperationService(Protocol):
    """Carries out operations in the process that analyses the unit."""

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Carry out an operation on an alarm; return the stored alarm.

        Raises
        ------
        LookupError
            If there is no such alarm.
        ActionRefusedError
            If the operation does not fit the state of the alarm.
        CommandFailedError
            If no process carries it out, or the disk does not answer.
        """

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Carry out an action on the baselines of a bearing; it is stored on return.

        Raises
        ------
        BaselineRefusedError
            If the action does not fit the baselines.
        CommandFailedError
            If no process carries it out.
        """

    async def refer_to(self, reference: VectorReference) -> None:
        """Apply a 1× reference that was just stored."""


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
    refresh_s
        Period of results.
    receivers
        Returns the state of all receivers of alarm messages.
    evidence
        State of the evidence of alarms; None where none is kept.
    configuration
        Plant file without secrets; None where none is kept.
    metrics
        Metrics for Prometheus; None without metrics.
    loops
        Fault of each loop of the program; None if it is alive.
    stored_trouble
        Known damage of stored data; None if there is none.
    checks
        Further checks of readiness by name; they are shown only.
    access
        Identifies callers; None for one without logins on this computer.
    space
        Watch of the disks; None without one.
    load
        Requests refused under load; None if none ever are.
    tape
        Continuous recording; None if this process records nothing.
    recordings
        Folders of recordings, starting with recordings around alarms; None without any.
    faults
        Faults of damaged recordings by name.
    refusals
        Log of refused requests; None for one of the application's own.
    sources
        Sources with timed polls, by unit.
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
        """Return a unit; raise a problem of status 404 without it."""
        if unit not in self.units:
            raise ProblemError(404, "Unknown unit", f"there is no unit {unit!r} in this plant")
        return self.units[unit]

    def bearing(self, unit: str, bearing: str) -> BearingSettings:
        """Return a bearing; raise a problem of status 404 without it."""
        for settings in self.unit(unit).bearing:
            if settings.id == bearing:
                return settings
        raise ProblemError(404, "Unknown bearing", f"unit {unit!r} has no bearing {bearing!r}")

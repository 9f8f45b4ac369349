"""`Context`: parts of the serving process that the API uses."""

import pathlib
from collections.abc import Awaitable, Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Path

from acquisition.clock import Clock
from service.api.answers import Answers
from service.api.auth.authenticator import Authenticator
from service.api.downloads import Downloads
from service.api.problems import ProblemError
from service.live.alarm_list import LiveAlarms
from service.live.commands import Operators
from service.live.current_state import LiveFilms, LiveUnits
from service.live.receivers import ReceiverView
from service.live.references import ReferencesInForce
from service.live.snapshot import PlantSnapshot
from service.settings.bearings import BearingSettings
from service.settings.configuration import Configuration
from service.settings.storage import Origin
from service.settings.units import UnitSettings
from service.store.store import Store

UnitId = Annotated[str, Path(description="Identifier of a unit.", examples=["U1"])]
BearingId = Annotated[str, Path(description="Identifier of a bearing.", examples=["UJB"])]
QuantityName = Annotated[
    str, Path(description="Name from the catalogue.", examples=["dynamic_k_xx_n_per_m"])
]


@dataclass(frozen=True)
class Context:
    """Parts of the serving process that the API uses.

    Parameters
    ----------
    units
        Settings of all units, by identifier of the unit.
    live, alarms, films, references
        Present state of units, alarms and oil films, and gap references in force.
    plant
        Function that returns the newest state of the measuring process.
    operators
        Sender of operators' commands.
    refresh_s
        Time between successive results, s.
    origin
        Origin of the data: live, or replay of a recording.
    receivers
        Function that returns the state of all receivers of alarm messages.
    max_shelf_s
        Maximum duration of shelving an alarm, s.
    configuration
        Plant file without secrets; None if the configuration is not kept.
    metrics
        Function that returns the metrics for Prometheus as text; None without metrics.
    loops
        Function that returns the fault of each background loop, by name; None without a fault.
    checks
        Function that returns results of further health checks, by name, which do not affect
        readiness.
    access
        Authenticator of callers.
    recordings
        Folders of recordings, the first for recordings around alarms; None without recordings.
    """

    plant_name: str
    units: Mapping[str, UnitSettings]
    live: LiveUnits
    alarms: LiveAlarms
    films: LiveFilms
    plant: Callable[[], PlantSnapshot]
    operators: Operators
    references: ReferencesInForce
    store: Store
    clock: Clock
    refresh_s: float
    receivers: Callable[[], Awaitable[Sequence[ReceiverView]]]
    access: Authenticator
    origin: Origin = Origin.LIVE
    max_shelf_s: float = 86_400.0
    configuration: Configuration | None = None
    downloads: Downloads = field(default_factory=Downloads)
    answers: Answers = field(default_factory=Answers)
    metrics: Callable[[], Awaitable[bytes]] | None = None
    loops: Callable[[], Mapping[str, str | None]] = dict
    checks: Callable[[], Mapping[str, str]] = dict
    recordings: Sequence[pathlib.Path] | None = None

    def now_revision(self, unit: str) -> Hashable:
        """Return a value that changes when the state of a unit or its films changes."""
        found: list[Hashable] = [self.live.revision(unit)]
        for bearing in self.units[unit].bearing:
            news = self.films.newest(unit, bearing.id)
            baseline = self.films.baseline(unit, bearing.id)
            found.append((news and news.reading.time_ns, baseline and baseline.origin.version))
        return tuple(found)

    def past_revision(self, unit: str, times: tuple[int, int]) -> Hashable:
        """Return a value that changes with a time range and with the stored results in it.

        `times` are the start and the end of the range, ns since 1970 UTC.
        """
        return times, self.live.past_revision(unit, times[1])

    def unit(self, unit: str) -> UnitSettings:
        """Return the settings of a unit; raise a problem of status 404 for an unknown unit."""
        if unit not in self.units:
            raise ProblemError(404, "Unknown unit", f"unknown unit {unit!r}; see /api/v1/units")
        return self.units[unit]

    def bearing(self, unit: str, bearing: str) -> BearingSettings:
        """Return the settings of a bearing; raise a problem of status 404 if it is unknown."""
        for settings in self.unit(unit).bearing:
            if settings.id == bearing:
                return settings
        raise ProblemError(404, "Unknown bearing", f"unit {unit!r} has no bearing {bearing!r}")

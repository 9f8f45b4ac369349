"""What the API's routes work with."""

import pathlib
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Path
from prometheus_client.registry import Collector

from acquisition.clock import Clock
from service.api.auth.desk import AccessDesk
from service.api.auth.refusals import Refusals
from service.api.delivery_look import DeliveryLook
from service.api.downloads import Downloads
from service.api.load.watch import LoadWatch
from service.api.ports import CaptureLook, FilmBoard, LiveLook, Operators
from service.api.problems import ProblemError
from service.live.alarm_board import AlarmBoard
from service.live.evidence import EvidenceStatus
from service.measuring.references_in_force import ReferencesInForce
from service.recordings.continuous_recorder import Tape
from service.runtime.disk import SpaceWatch
from service.runtime.polls import TimedSource
from service.settings.bearings import BearingSettings
from service.settings.configuration import Configuration
from service.settings.storage import Origin
from service.settings.units import UnitSettings
from service.store.port import Store

UnitId = Annotated[str, Path(description="Identifier of a unit.", examples=["U1"])]
BearingId = Annotated[str, Path(description="Identifier of a bearing.", examples=["UJB"])]
QuantityName = Annotated[
    str, Path(description="Name from the catalogue.", examples=["dynamic_k_xx_n_per_m"])
]


@dataclass(frozen=True)
class Context:
    """The running service, as far as the API needs it.

    Parameters
    ----------
    refresh_s
        Time from one result to the next.
    evidence
        How the evidence of alarms is kept; None where none is.
    configuration
        What the plant is configured as, without its secrets; None where none is kept.
    metrics
        What is told to Prometheus; None where nobody asks.
    loops
        What is wrong with each loop of the program; None where nothing is.
    stored_trouble
        In what stored data are not what was stored; None as far as nothing is known to be wrong.
    checks
        What readiness is told besides, by name; none of it makes the service unready.
    access
        Tells who asks; None for one that asks nobody on this computer.
    space
        Knows how full the disks are; None where nobody looks.
    load
        Knows which questions are refused now; None where none ever are.
    tape
        Continuous recording; None where this process records nothing.
    recordings
        Folders of recordings, that of captures first; None where none are kept.
    faults
        Why each recording that is known to be damaged is, by name.
    refusals
        Takes refused requests; None for a taker of the application's own.
    sources
        Where samples come from, by unit; of those whose polls are timed.
    """

    plant_name: str
    units: Mapping[str, UnitSettings]
    live: LiveLook
    store: Store
    clock: Clock
    refresh_s: float
    references: ReferencesInForce
    alarms: AlarmBoard
    films: FilmBoard
    operators: Operators
    captures: CaptureLook
    deliveries: DeliveryLook
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
    access: AccessDesk | None = None
    space: SpaceWatch | None = None
    load: LoadWatch | None = None
    tape: Tape | None = None
    recordings: Sequence[pathlib.Path] | None = None
    faults: Callable[[], Mapping[str, str]] = dict

    def unit(self, unit: str) -> UnitSettings:
        """Look a unit up, or answer 404."""
        if unit not in self.units:
            raise ProblemError(404, "Unknown unit", f"there is no unit {unit!r} in this plant")
        return self.units[unit]

    def bearing(self, unit: str, bearing: str) -> BearingSettings:
        """Look a bearing up, or answer 404."""
        for settings in self.unit(unit).bearing:
            if settings.id == bearing:
                return settings
        raise ProblemError(404, "Unknown bearing", f"unit {unit!r} has no bearing {bearing!r}")

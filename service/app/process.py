"""Parts that every process of a plant shares: context, live view, supervision."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import structlog

from acquisition.clock import Clock
from service.live.live_view import LinkState, LiveView, UnitStatus
from service.measuring.timings import Timings
from service.runtime.heartbeats import Heartbeats
from service.runtime.service_manager import ServiceManager
from service.settings.core_values import analysis_of
from service.settings.plant import PlantFile
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import Origin
from service.store.store import Store

STALE_HOPS = 2.5
"""A result older than this many refreshes is no longer current."""


@dataclass(frozen=True)
class Ground:
    """Context of one process: plant, store, live view, heartbeats and timings.

    Parameters
    ----------
    origin
        Origin of the data in the store and in all answers.
    beats
        Heartbeats of every loop of the process.
    """

    plant: PlantFile
    origin: Origin
    clock: Clock
    store: Store
    live: LiveView
    beats: Heartbeats
    timings: Timings

    @property
    def refresh_s(self) -> float:
        """Seconds between results of the slowest unit."""
        return refresh_s(self.plant)


def live_view(plant: PlantFile, clock: Clock) -> LiveView:
    """Return the live view of a plant before its first samples."""
    return LiveView([unit.id for unit in plant.unit], clock, STALE_HOPS * refresh_s(plant))


def refresh_s(plant: PlantFile) -> float:
    """Return the seconds between results of a plant's slowest unit."""
    hop_samples = analysis_of(plant.analysis).hop_samples
    return max(
        (unit.source.hop_polls if isinstance(unit.source, ModbusVectorSettings) else hop_samples)
        / unit.sampling_hz
        for unit in plant.unit
    )


log = structlog.get_logger()

LOOK_EVERY_S = 10.0


class Links(Protocol):
    """Provider of the link status of units."""

    def status(self, unit: str) -> UnitStatus:
        """Return the link status of a unit."""
        ...


class Supervision:
    """Notifies the watchdog while every loop is alive, and logs loops that are not.

    It runs on the event loop, so a blocked event loop stops the notifications.
    """

    def __init__(
        self,
        manager: ServiceManager,
        beats: Heartbeats,
        live: Links,
        units: Iterable[str],
        clock: Clock,
    ) -> None:
        self._manager, self._beats, self._live, self._clock = manager, beats, live, clock
        self._units = tuple(units)
        self._told: set[str] = set()
        half_s = LOOK_EVERY_S if manager.watchdog_s is None else manager.watchdog_s / 2.0
        self._every_s = min(LOOK_EVERY_S, half_s)

    def ready(self) -> None:
        """Notify the service manager that the service is ready."""
        self._manager.tell(READY="1", STATUS=self._status())

    def stopping(self) -> None:
        """Notify the service manager that the service is stopping."""
        self._manager.tell(STOPPING="1", STATUS="stopping")

    async def run(self) -> None:
        """Check the loops until cancelled."""
        while True:
            self.look()
            await self._clock.sleep(self._every_s)

    def look(self) -> None:
        """Check the loops once."""
        troubles = self._beats.troubles
        words = [f"{name} {trouble}" for name, trouble in troubles.items()]
        if set(troubles) != self._told:
            self._told = set(troubles)
            _log(words)
        if words:
            self._manager.tell(STATUS="; ".join(words))
        else:
            self._manager.tell(WATCHDOG="1", STATUS=self._status())

    def _status(self) -> str:
        states = [self._live.status(unit).state for unit in self._units]
        return f"{states.count(LinkState.CONNECTED)} of {len(states)} units connected"


def _log(words: list[str]) -> None:
    if words:
        log.error("a loop of the program is not alive", loops=words)
    else:
        log.info("all loops are alive again")

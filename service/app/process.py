"""Common parts of all processes of a plant: context, live view, supervision, server."""

import asyncio
import socket
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import structlog

from acquisition.clock import Clock
from service.api.http.listening import url_of
from service.api.http.server import GuardedServer
from service.live.live_view import LinkState, LiveView, UnitStatus
from service.measuring.timings import Timings
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import ServiceManager
from service.settings.core_values import analysis_of
from service.settings.plant import PlantFile
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import Origin
from service.store.store import Store

STALE_HOPS = 2.5
"""Age of a result in refresh periods above which the result is stale."""


@dataclass(frozen=True)
class ProcessContext:
    """Context of one process: plant, store, live view, heartbeats and timings.

    Parameters
    ----------
    origin
        Origin of the data in the store and in all API responses.
    beats
        Heartbeats of all loops of the process.
    """

    plant: PlantFile
    origin: Origin
    clock: Clock
    store: Store
    live: LiveView
    beats: Heartbeats
    timings: Timings


def live_view(plant: PlantFile, clock: Clock) -> LiveView:
    """Return an empty live view of the units of a plant."""
    return LiveView([unit.id for unit in plant.unit], clock, STALE_HOPS * refresh_s(plant))


def refresh_s(plant: PlantFile) -> float:
    """Return the result period of the slowest unit of a plant, s."""
    hop_samples = analysis_of(plant.analysis).hop_samples
    return max(
        (unit.source.hop_polls if isinstance(unit.source, ModbusVectorSettings) else hop_samples)
        / unit.sampling_hz
        for unit in plant.unit
    )


def start_loops(
    loops: Mapping[str, Loop], beats: Heartbeats, tasks: asyncio.TaskGroup
) -> list[asyncio.Task[None]]:
    """Start each loop as a named task with a heartbeat."""
    return [tasks.create_task(beats.tend(name, loop), name=name) for name, loop in loops.items()]


log = structlog.get_logger()

LOOK_EVERY_S = 10.0


class Links(Protocol):
    """Provider of the link status of units."""

    def status(self, unit: str) -> UnitStatus:
        """Return the link status of a unit."""
        ...


class Supervision:
    """Supervision of loops: notifies the watchdog while all loops are alive, logs dead loops.

    Supervision runs on the event loop, so that a blocked event loop stops the notifications.
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
        self._logged: set[str] = set()
        half_s = LOOK_EVERY_S if manager.watchdog_s is None else manager.watchdog_s / 2.0
        self._every_s = min(LOOK_EVERY_S, half_s)

    def ready(self) -> None:
        """Notify the service manager that the service is ready."""
        self._manager.notify(READY="1", STATUS=self._status())

    def stopping(self) -> None:
        """Notify the service manager that the service is stopping."""
        self._manager.notify(STOPPING="1", STATUS="stopping")

    async def run(self) -> None:
        """Check the heartbeats of all loops periodically until cancelled."""
        while True:
            self.look()
            await self._clock.sleep(self._every_s)

    def look(self) -> None:
        """Check the heartbeats of all loops once."""
        troubles = self._beats.troubles
        words = [f"{name} {trouble}" for name, trouble in troubles.items()]
        if set(troubles) != self._logged:
            self._logged = set(troubles)
            if words:
                log.error("a loop of the program has failed", loops=words)
            else:
                log.info("all loops of the program run again")
        if words:
            self._manager.notify(STATUS="; ".join(words))
        else:
            self._manager.notify(WATCHDOG="1", STATUS=self._status())

    def _status(self) -> str:
        states = [self._live.status(unit).state for unit in self._units]
        return f"{states.count(LinkState.CONNECTED)} of {len(states)} units connected"


Begin = Callable[[asyncio.TaskGroup, asyncio.Event], list[asyncio.Task[None]]]
"""Function that starts the tasks of a process; setting the event stops the process."""


async def _nothing() -> None:
    """Do nothing."""


@dataclass(frozen=True)
class ProcessServer:
    """HTTP server of a process; the tasks of the process run while it serves.

    Parameters
    ----------
    name
        Name of the server's heartbeat.
    announce
        Called with the URL when the server accepts requests.
    prepare
        Awaited after `announce`; for preparation that may follow the first requests.
    """

    name: str
    server: GuardedServer
    listener: socket.socket
    announce: Callable[[str], None]
    prepare: Callable[[], Awaitable[None]] = _nothing

    async def run(
        self,
        supervision: Supervision,
        beats: Heartbeats,
        begin: Begin,
        drain: Callable[[], Awaitable[None]] = _nothing,
    ) -> None:
        """Serve, and run the tasks of the process, until SIGINT or SIGTERM.

        Parameters
        ----------
        begin
            Starts the tasks of the process, which are cancelled at its end.
        drain
            Awaited before the tasks are cancelled.
        """
        stopped = stop_on_signals()
        async with asyncio.TaskGroup() as tasks:
            begun = begin(tasks, stopped)
            serve: Loop = partial(self.server.run_on, self.listener)
            [serving] = start_loops({self.name: serve}, beats, tasks)
            begun.append(tasks.create_task(self._announce(supervision), name="announce"))
            supervising = tasks.create_task(supervision.run(), name="supervise")
            await stopped.wait()
            supervision.stopping()
            supervising.cancel()
            self.server.should_exit = True
            await drain()
            for task in begun:
                task.cancel()
            await asyncio.wait([serving])

    async def _announce(self, supervision: Supervision) -> None:
        while not self.server.started:
            await asyncio.sleep(0.01)
        supervision.ready()
        self.announce(url_of(self.listener, has_tls=self.server.config.is_ssl))
        await self.prepare()

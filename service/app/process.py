"""Supervision of the background loops of a process, and its run until a signal."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Protocol

import structlog

from acquisition.clock import Clock
from service.live.status import LinkState, UnitStatus
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import ServiceManager


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
    """Supervisor of loops, which notifies the watchdog while all are alive and logs dead loops.

    The supervisor runs on the event loop, so that a blocked event loop stops the notifications.
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


async def run_until_stopped(
    supervision: Supervision,
    begin: Begin,
    drain: Callable[[], Awaitable[None]] = _nothing,
) -> None:
    """Run the tasks of a process until SIGINT or SIGTERM.

    Parameters
    ----------
    begin
        Function that starts the tasks of the process, which are cancelled at its end.
    drain
        Coroutine function that is called before the tasks are cancelled.
    """
    stopped = stop_on_signals()
    async with asyncio.TaskGroup() as tasks:
        begun = begin(tasks, stopped)
        supervising = tasks.create_task(supervision.run(), name="supervise")
        await stopped.wait()
        supervision.stopping()
        supervising.cancel()
        await drain()
        for task in begun:
            task.cancel()

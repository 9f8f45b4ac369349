"""Supervision of the background loops of a process, and its run until a signal."""

import asyncio
import socket
from collections.abc import Awaitable, Callable, Collection, Coroutine, Mapping
from dataclasses import dataclass, field
from typing import Any

import structlog

from acquisition.clock import Clock
from service.live.status import LinkState, UnitStatus
from service.runtime.heartbeats import Heartbeats, Loop
from service.runtime.process import stop_on_signals
from service.runtime.service_manager import NO_MANAGER, ServiceManager

log = structlog.get_logger()

LOOK_EVERY_S = 10.0


@dataclass(frozen=True)
class Host:
    """Surroundings of a process.

    Parameters
    ----------
    listener
        Listening socket of the API, or of the health page.
    announce
        Function that is called with the URL when requests are served, and with the set-up token if
        there is no account.
    manager
        Service manager, notified when the process is ready, alive and stopping.
    """

    listener: socket.socket
    clock: Clock
    announce: Callable[[str], None]
    manager: ServiceManager = NO_MANAGER


@dataclass
class Supervision:
    """Supervisor of loops that notifies the watchdog while all loops run, and logs dead loops.

    The supervisor runs on the event loop, so that a blocked event loop stops the notifications.
    `status` returns the link status of a unit.
    """

    host: Host
    beats: Heartbeats
    status: Callable[[str], UnitStatus]
    units: Collection[str]
    _logged: set[str] = field(default_factory=set, init=False)

    def ready(self) -> None:
        """Notify the service manager that the service is ready."""
        self.host.manager.notify(READY="1", STATUS=self._status())

    def announce(self, url: str, token: str | None = None) -> None:
        """Notify the service manager; announce the URL and, unless it is None, the set-up token."""
        self.ready()
        self.host.announce(url)
        if token is not None:
            self.host.announce(
                f"token to create the first account, valid once within one hour: {token}"
            )

    def stopping(self) -> None:
        """Notify the service manager that the service is stopping."""
        self.host.manager.notify(STOPPING="1", STATUS="stopping")

    async def run(self) -> None:
        """Check the heartbeats of all loops periodically until cancelled."""
        watchdog_s = self.host.manager.watchdog_s
        every_s = LOOK_EVERY_S if watchdog_s is None else min(LOOK_EVERY_S, watchdog_s / 2.0)
        while True:
            self.look()
            await self.host.clock.sleep(every_s)

    def look(self) -> None:
        """Check the heartbeats of all loops once; notify the watchdog, log loops that stopped."""
        troubles = self.beats.troubles
        words = [f"{name} {trouble}" for name, trouble in troubles.items()]
        if set(troubles) != self._logged:
            self._logged = set(troubles)
            if words:
                log.error("background tasks have ended or no longer respond", tasks=words)
            else:
                log.info("all background tasks respond again")
        if words:
            self.host.manager.notify(STATUS="; ".join(words))
        else:
            self.host.manager.notify(WATCHDOG="1", STATUS=self._status())

    def _status(self) -> str:
        states = [self.status(unit).state for unit in self.units]
        return f"{states.count(LinkState.CONNECTED)} of {len(states)} units connected"

    async def run_until_stopped(
        self,
        loops: Mapping[str, Loop],
        job: Callable[[], Coroutine[Any, Any, None]] = lambda: asyncio.sleep(0),
        drain: Callable[[asyncio.Task[None]], Awaitable[None]] | None = None,
        *,
        ends: bool = False,
    ) -> None:
        """Run the loops and the job of a process until SIGINT or SIGTERM.

        Parameters
        ----------
        job
            Coroutine function of the main work, without heartbeats; it may end early.
        drain
            Coroutine function that is called with the task of the job before the cancellation.
        ends
            Whether the process stops when the job has ended.
        """
        stopped = stop_on_signals()
        async with asyncio.TaskGroup() as tasks:
            working = tasks.create_task(job(), name="run")
            if ends:
                working.add_done_callback(lambda _: stopped.set())
            begun = [working, *self.beats.start(loops, tasks)]
            supervising = tasks.create_task(self.run(), name="supervise")
            await stopped.wait()
            self.stopping()
            supervising.cancel()
            if drain is not None:
                await drain(working)
            for task in begun:
                task.cancel()

"""`Supervision`: what the service manager hears while the program runs."""

from collections.abc import Iterable
from typing import Protocol

import structlog

from acquisition.clock import Clock
from service.live.live_view import LinkState, UnitStatus
from service.runtime.heartbeats import Heartbeats
from service.runtime.service_manager import ServiceManager

log = structlog.get_logger()

LOOK_EVERY_S = 10.0


class Links(Protocol):
    """Whoever knows how samples of a unit arrive."""

    def status(self, unit: str) -> UnitStatus:
        """How samples of a unit arrive."""
        ...


class Supervision:
    """Feeds the watchdog while every loop is alive, and says which one is not.

    It lives on the event loop itself: when that is blocked, nothing is fed.
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
        """Say that the service answers."""
        self._manager.tell(READY="1", STATUS=self._status())

    def stopping(self) -> None:
        """Say that it is being stopped."""
        self._manager.tell(STOPPING="1", STATUS="stopping")

    async def run(self) -> None:
        """Look at the loops for ever."""
        while True:
            self.look()
            await self._clock.sleep(self._every_s)

    def look(self) -> None:
        """Look at the loops once."""
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

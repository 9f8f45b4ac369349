"""`Soundness`: tells, while the service runs, that stored data are not what was stored."""

import asyncio

import structlog

from acquisition.clock import Clock
from service.live.live_view import LiveView
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.access.audit_entries import AuditAction
from service.store.port import StoreError
from service.store.seals import Place
from service.store.store import Store

log = structlog.get_logger()

LOOK_EVERY_S = 3.0
"""A database file that was removed or replaced is noticed so soon."""

MAX_TOLD = 100
"""Damaged rows that get an entry of the audit trail each, from one start to the next."""


class Soundness:
    """Looks at what the store knows of itself; goes on with it as it is, and tells.

    Parameters
    ----------
    live
        Is told that nothing can be stored while the database's file is not the one that is open.

    Attributes
    ----------
    rolled_back
        What was wrong with the database since the start; None if it was what was here last.
    """

    def __init__(self, store: Store, clock: Clock, live: LiveView) -> None:
        self._store, self._clock, self._live = store, clock, live
        self._told: set[Place] = set()
        self._no_file: str | None = None
        self.rolled_back: str | None = None

    @property
    def n_damaged(self) -> int:
        """Rows that were found damaged since the start; they are left out of all answers."""
        return self._store.integrity.n_damaged

    @property
    def mark_error(self) -> str | None:
        """Why the high-water mark could not be written last; None if it could."""
        return self._store.integrity.mark_error

    @property
    def trouble(self) -> str | None:
        """What there is to say in a line; None if nothing is known to be wrong."""
        mark, n_damaged = self.mark_error, self.n_damaged
        said = [
            self._no_file,
            self.rolled_back,
            mark and f"the high-water mark cannot be written: {mark}",
        ]
        if n_damaged:
            said.append(f"{n_damaged} stored rows are damaged, and left out")
        return "; ".join(words for words in said if words) or None

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            await self.look()
            pulse.beat(LOOK_EVERY_S)
            await self._clock.sleep(LOOK_EVERY_S)

    async def look(self) -> None:
        """Take over what was found since the last look."""
        if not await self._has_file():
            return
        try:
            await asyncio.to_thread(self._look)
        except StoreError as error:
            log.error("what is wrong with stored data cannot be told", reason=str(error))

    async def _has_file(self) -> bool:
        """Whether the database's file is the one that is open."""
        before = self._no_file
        try:
            await asyncio.to_thread(self._store.integrity.require_file)
        except StoreError as error:
            self._no_file = self._live.store_error = str(error)
            if before is None:
                log.error("the database file is gone", reason=self._no_file)
            return False
        self._no_file = None
        if before is not None:
            log.info("the database file is back")
            if self._live.store_error == before:
                self._live.store_error = None
        return True

    def _look(self) -> None:
        found = self._store.integrity.adopt(self._clock.now_ns())
        if found:
            self.rolled_back = "; ".join(finding.detail for finding in found)
            log.error("the database is not what was here last", reason=self.rolled_back)
        news = [place for place in self._store.integrity.damaged if place not in self._told]
        news = news[: max(0, MAX_TOLD - len(self._told))]
        if news:
            self._store.audit.record([self._deed(place) for place in news])
            self._told.update(news)
            log.error("stored rows are damaged", n_rows=len(news), first=str(news[0]))

    def _deed(self, place: Place) -> AuditAction:
        return AuditAction(
            time_ns=self._clock.now_ns(),
            actor="padwatch",
            action="store.row_damaged",
            object=f"{place.table}: {place.key}",
            reason="the row is gone"
            if place.is_missing
            else "the row does not fit its seal and is left out",
        )

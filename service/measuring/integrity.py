"""Monitor of the integrity of stored data while the service runs."""

import asyncio

import structlog

from acquisition.clock import Clock
from service.measuring.live_view import LiveView
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.access.audit_entries import AuditAction
from service.store.port import StoreError
from service.store.seals import Place
from service.store.store import Store

log = structlog.get_logger()

LOOK_EVERY_S = 3.0
"""Period of the integrity checks, s; the longest time until a missing database file is noticed."""

MAX_REPORTED = 100
"""Maximum number of damaged and missing rows per run that the audit trail records."""


class IntegrityMonitor:
    """Monitor of the database: damaged or missing rows, an outdated copy, a missing file.

    The store error of `live` is set while the database file is missing or replaced.

    Attributes
    ----------
    stored
        Checks of the stored data, and their results.
    rolled_back
        Description of how the database differs from that of the last run; None if it is the same.
    access_trouble
        Faults of the database of accounts that the serving process reported; None without faults.
    """

    def __init__(self, store: Store, clock: Clock, live: LiveView) -> None:
        self.stored, self._audit = store.integrity, store.audit
        self._clock, self._live = clock, live
        self._reported: set[Place] = set()
        self._file = TroubleLog(
            "the database file is missing or replaced", "the database file is in place again"
        )
        self.rolled_back: str | None = None
        self.access_trouble: str | None = None

    @property
    def trouble(self) -> str | None:
        """Description of all integrity faults in one line; None without faults."""
        mark, n_damaged = self.stored.mark_error, self.stored.n_damaged
        faults = [
            self._file.trouble,
            self.rolled_back,
            mark and f"the high-water mark cannot be written: {mark}",
            self.access_trouble and f"accounts: {self.access_trouble}",
        ]
        if n_damaged:
            faults.append(f"damaged or missing rows: {n_damaged} (see the audit trail)")
        return "; ".join(each for each in faults if each) or None

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Check the database periodically, until cancelled; `pulse` gets heartbeats."""
        await periodic(self.look, LOOK_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Check the database file and stored rows once; log and audit new faults."""
        if not await self._has_file():
            return
        try:
            await asyncio.to_thread(self._look)
        except StoreError as error:
            log.error("the integrity of stored data cannot be checked", reason=str(error))

    async def _has_file(self) -> bool:
        """Return whether the database file exists and is the file that this process has open."""
        before = self._file.trouble
        try:
            await asyncio.to_thread(self.stored.require_file)
        except StoreError as error:
            self._live.store_error = str(error)
            self._file.note(str(error))
            return False
        self._file.note(None)
        if before is not None and self._live.store_error == before:
            self._live.store_error = None
        return True

    def _look(self) -> None:
        found = self.stored.adopt(self._clock.now_ns())
        if found:
            self.rolled_back = "; ".join(finding.detail for finding in found)
            log.error(
                "the database may not be the newest; results and alarms may be missing",
                reason=self.rolled_back,
            )
        news = [place for place in self.stored.damaged if place not in self._reported]
        news = news[: max(0, MAX_REPORTED - len(self._reported))]
        if news:
            self._audit.record([_damage(place, self._clock.now_ns()) for place in news])
            self._reported.update(news)
            first = f"{news[0].table}: {news[0].key}"
            log.error("stored rows are damaged or missing", n_rows=len(news), first=first)


def _damage(place: Place, now_ns: int) -> AuditAction:
    fault = "does not match its checksum; queries omit it"
    reason = f"the row {'is missing' if place.is_missing else fault}"
    where = f"{place.table}: {place.key}"
    return AuditAction(now_ns, "padwatch", "store.row_damaged", where, reason=reason)

"""Audit entries for refused requests, with a rate limit."""

import asyncio

import structlog

from acquisition.clock import Clock
from service.api.auth.backoff import TokenBucket
from service.store.access.audit_entries import AuditAction, acting
from service.store.audit import AuditStore
from service.store.port import StoreError

log = structlog.get_logger()

SAFE = ("GET", "HEAD", "OPTIONS")
"""Safe HTTP methods, which change no state."""

REFUSED = (401, 403, 409, 413, 422, 429)
"""HTTP statuses of refused requests."""

REQUEST_REFUSED = "request.refused"

N_AT_ONCE = 20
"""Burst limit: maximum number of refusals in quick succession that are recorded."""

SECONDS_EACH = 30.0
"""Time after which one more refusal may be recorded, s: at most 2,880 a day."""


class Refusals:
    """Writer of audit entries for refused requests; above a rate limit, requests are only counted.

    `n_more` is the number of refused requests since the newest entry that were only counted.
    """

    def __init__(self, audit: AuditStore, clock: Clock) -> None:
        self._audit, self._clock = audit, clock
        self._allowance = TokenBucket(N_AT_ONCE, SECONDS_EACH, clock.monotonic_s())
        self.n_more = 0

    async def note(self, operation: str, reason: str, status: int) -> None:
        """Record a refused request; above the rate limit, count it for the next entry.

        If the entry cannot be stored, the error is logged and the request is counted. `operation`
        is method and path of the request; `reason` and `status` are the reason and the HTTP status
        in the answer.
        """
        if not self._allowance.take(self._clock.monotonic_s()):
            self.n_more += 1
            return
        n_before, self.n_more = self.n_more, 0
        after = {"status": status} | ({"n_refused_more": n_before} if n_before else {})
        now_ns, who = self._clock.now_ns(), acting()
        what = (now_ns, who.actor, REQUEST_REFUSED, operation, None, after, reason)
        if not await self._record(AuditAction(*what, who.source, who.peer)):
            self.n_more += n_before + 1

    async def close(self) -> None:
        """Record the number of refused requests without an entry, if any; log a store error."""
        if self.n_more:
            now_ns, after = self._clock.now_ns(), {"n_refused_more": self.n_more}
            await self._record(AuditAction(now_ns, "padwatch", REQUEST_REFUSED, "", after=after))

    async def _record(self, entry: AuditAction) -> bool:
        try:
            await asyncio.to_thread(self._audit.record, [entry])
        except StoreError as error:
            log.error(
                "a refused request cannot be audited; the next entry will count it",
                reason=str(error),
            )
            return False
        return True

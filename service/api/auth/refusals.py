"""Refused requests in the audit trail: an entry each while they are few, a count beyond."""

import asyncio

import structlog

from acquisition.clock import Clock
from service.api.load.allowance import Allowance
from service.store.access.audit_entries import Deed
from service.store.audit_port import AuditStore
from service.store.port import StoreError

log = structlog.get_logger()

N_AT_ONCE = 20
"""Refusals that get an entry each, however fast they come."""

SECONDS_EACH = 30.0
"""How long it takes until one more may have one: at most 2,880 a day."""


class Refusals:
    """Writes refusals, and counts those that come too fast to be written one by one.

    Parameters
    ----------
    audit
        Where they are written.
    """

    def __init__(self, audit: AuditStore, clock: Clock) -> None:
        self._audit, self._clock = audit, clock
        self._allowance = Allowance(N_AT_ONCE, SECONDS_EACH, clock.monotonic_s())
        self.n_more = 0

    async def note(self, deed: Deed, status: int) -> None:
        """Write a refusal, with how many went before it unwritten, or count it."""
        if not self._allowance.take(self._clock.monotonic_s()):
            self.n_more += 1
            return
        n_before, self.n_more = self.n_more, 0
        after = {"status": status} | ({"n_refused_more": n_before} if n_before else {})
        entry = Deed(**{**vars(deed), "after": after})
        try:
            await asyncio.to_thread(self._audit.record, [entry])
        except StoreError as error:
            self.n_more += n_before + 1
            log.error("a refused request is not in the audit trail", reason=str(error))

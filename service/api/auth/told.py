"""What the audit trail is told of logins."""

import asyncio

from acquisition.clock import Clock
from service.store.access.audit_entries import Deed, acting, name_actor
from service.store.audit_port import AuditStore

BEGUN, ENDED = "session.begun", "session.ended"


async def tell(audit: AuditStore, clock: Clock, action: str, name: str) -> None:
    """Write down that somebody has logged in or out.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    name_actor(name)
    who = acting()
    deed = Deed(clock.now_ns(), name, action, name, source=who.source, peer=who.peer)
    await asyncio.to_thread(audit.record, [deed])

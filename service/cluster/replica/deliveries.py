"""`ReplicaDeliveries`: who is told of alarms, as far as the outbox tells; others do the telling."""

import asyncio
from collections.abc import Sequence

from service.notifications.sender import Receiver, ReceiverView, SenderState, SenderStatus
from service.store.outbox_port import Backlog, Outbox


class ReplicaDeliveries:
    """Looks at the outbox; sends nothing."""

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox) -> None:
        self._receivers, self._outbox = {r.name: r for r in receivers}, outbox

    async def look(self) -> list[ReceiverView]:
        """Look at all receivers.

        Raises
        ------
        StoreError
            If the outbox cannot be read.
        """
        return await asyncio.to_thread(self._look)

    def _look(self) -> list[ReceiverView]:
        backlogs = {backlog.receiver: backlog for backlog in self._outbox.backlogs()}
        others = [name for name in backlogs if name not in self._receivers]
        return [self._view(name, backlogs.get(name)) for name in (*self._receivers, *others)]

    def _view(self, name: str, backlog: Backlog | None) -> ReceiverView:
        receiver = self._receivers.get(name)
        return ReceiverView(name, receiver, self._status(name) if receiver else None, backlog)

    def _status(self, name: str) -> SenderStatus:
        """By the first letter that waits: whether it was tried in vain, and why."""
        waiting = self._outbox.waiting(name, 1)
        if not waiting:
            return SenderStatus()
        first = waiting[0]
        if not first.n_attempts:
            return SenderStatus(SenderState.SENDING)
        return SenderStatus(SenderState.RETRYING, first.n_attempts, first.queued_ns, first.answer)

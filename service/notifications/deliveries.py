"""All receivers of a running service."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.clock import Clock
from service.notifications.sender import Receiver, Sender, SenderStatus
from service.runtime.heartbeats import Heartbeats
from service.store.outbox_port import Backlog, Outbox


@dataclass(frozen=True)
class ReceiverView:
    """A receiver as it is shown.

    Parameters
    ----------
    receiver, status
        None of one that is in the plant file no longer; what waits for it goes on waiting.
    backlog
        None if there never was anything for it.
    """

    name: str
    receiver: Receiver | None
    status: SenderStatus | None
    backlog: Backlog | None


class Deliveries:
    """Runs a sender for each receiver; one never waits for another.

    Parameters
    ----------
    receivers
        None in a replay, which tells nobody.
    """

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox, clock: Clock) -> None:
        self._senders = [Sender(receiver, outbox, clock) for receiver in receivers]
        self._outbox, self._clock = outbox, clock

    async def run(self, beats: Heartbeats | None = None) -> None:
        """Deliver for ever."""
        beats = beats or Heartbeats(self._clock)
        loops = {f"deliver {sender.receiver.name}": sender.run for sender in self._senders}
        try:
            async with asyncio.TaskGroup() as tasks:
                for name, loop in loops.items():
                    tasks.create_task(beats.tend(name, loop), name=name)
        except asyncio.CancelledError:
            beats.release(*loops)  # another process of the plant delivers from now on
            raise

    def wake(self) -> None:
        """Say that there may be something new in the outbox."""
        for sender in self._senders:
            sender.wake()

    async def look(self) -> list[ReceiverView]:
        """Look at all receivers.

        Raises
        ------
        StoreError
            If the outbox cannot be read.
        """
        backlogs = {b.receiver: b for b in await asyncio.to_thread(self._outbox.backlogs)}
        senders = {sender.receiver.name: sender for sender in self._senders}
        return [
            ReceiverView(
                name,
                sender.receiver if sender else None,
                sender.status if sender else None,
                backlogs.get(name),
            )
            for name in (*senders, *(other for other in backlogs if other not in senders))
            for sender in [senders.get(name)]
        ]

"""Senders: delivery of outbox messages to each receiver, one at a time in outbox order."""

import asyncio
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from core.units import ns_from_s
from service.live.receivers import (
    ReceiverView,
    SenderState,
    with_backlogs,
)
from service.notifications.channel import Channel, Delivered, Failed, Outcome
from service.notifications.message import loads
from service.runtime.heartbeats import UNHEARD, Heartbeats, Pulse
from service.settings.notifications import AnyReceiver
from service.store.outbox import MessageState, Outbox, StoredMessage
from service.store.port import StoreError

FIRST_WAIT_S = 1.0


def wait_s(
    n_failures: int,
    retry_after_s: float | None,
    max_s: float,
    share: Callable[[], float] = random.random,
) -> float:
    """Return the delay in s before the next attempt: exponential back-off less random jitter.

    Parameters
    ----------
    n_failures
        Number of consecutive failed attempts, 1 or more.
    retry_after_s
        Minimum delay requested by the receiver, limited to `max_s`; None if not requested.
    max_s
        Maximum delay.
    share
        Function that returns a random number from 0 to 1; the jitter is up to half the delay.
    """
    doubled_s = FIRST_WAIT_S * 2.0 ** min(n_failures - 1, 30)
    drawn_s = min(doubled_s, max_s) * (1.0 - 0.5 * share())
    return max(drawn_s, min(retry_after_s or 0.0, max_s))


log = structlog.get_logger()

BATCH = 50
"""Maximum number of outbox messages that a sender loads at once."""

LOOK_S = 30.0
"""Interval of outbox checks without `Sender.wake`: another process may have requeued messages, or
the quiet hours may have ended."""

STORE_RETRY_S = 1.0

MAX_SEND_S = 600.0
"""Maximum time-out of one attempt in the settings."""

T = TypeVar("T")


S_PER_H = 3600.0


@dataclass(frozen=True)
class Receiver:
    """Receiver of notifications, with its settings and its channel.

    `name` is unique among the receivers; messages in the outbox refer to it.
    """

    name: str
    settings: AnyReceiver
    channel: Channel

    def view(self, **status: Any) -> ReceiverView:
        """Return the receiver with the status of its sender, given as fields of the view."""
        return ReceiverView(self.name, self.settings.kind, self.channel.address, **status)


class Sender:
    """Background loop that delivers the waiting outbox messages of one receiver."""

    def __init__(self, receiver: Receiver, outbox: Outbox, clock: Clock) -> None:
        self.receiver, self.status = receiver, receiver.view()
        self._outbox, self._clock = outbox, clock
        self._begun = Arrival.now(clock)
        self._news = asyncio.Event()
        self._pulse: Pulse = UNHEARD

    def wake(self) -> None:
        """Wake the loop, which checks the outbox immediately."""
        self._news.set()

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Deliver messages until the task is cancelled, with heartbeats to `pulse`."""
        self._pulse = pulse
        while True:
            self._news.clear()
            if not await self._deliver_batch():
                pulse.beat(LOOK_S)
                await self._wake_up_or(LOOK_S)

    async def _deliver_batch(self) -> bool:
        """Deliver up to `BATCH` messages; return whether more messages may be waiting."""
        name = self.receiver.name
        letters = await self._stored(lambda: self._outbox.waiting(name, BATCH))
        for letter in letters:
            if await self._is_held():
                self._note(SenderState.QUIET)
                return False
            if not await self._deliver(letter):
                return True
        if not letters:
            self._note(SenderState.IDLE)
        return bool(letters)

    async def _is_held(self) -> bool:
        quiet = self.receiver.settings.quiet
        if quiet is None or not quiet.include(self._clock.now_ns()):
            return False
        return not await self._stored(lambda: self._outbox.urgent(self.receiver.name))

    async def _deliver(self, letter: StoredMessage) -> bool:
        """Make one attempt; return whether the message is delivered or permanently rejected."""
        self._note(SenderState.SENDING)
        self._pulse.beat(MAX_SEND_S)
        outcome = await self.receiver.channel.send(loads(letter.body), letter.body)
        if isinstance(outcome, Failed):
            await self._wait_after(letter, outcome)
            return False
        await self._finish(letter, outcome)
        return True

    async def _finish(self, letter: StoredMessage, outcome: Outcome) -> None:
        """Store the final outcome of a message, even if the task is cancelled meanwhile."""
        is_delivered = isinstance(outcome, Delivered)
        state = MessageState.DELIVERED if is_delivered else MessageState.REFUSED
        now_ns = self._clock.now_ns()
        await self._stored(
            lambda: self._outbox.finish(letter.id, state, outcome.answer, now_ns), to_the_end=True
        )
        write = log.info if is_delivered else log.error
        if not is_delivered or self.status.n_failures:
            outcome_words = "delivered after failures" if is_delivered else "permanently rejected"
            event = f"message {outcome_words}"
            write(event, receiver=self.receiver.name, id=letter.event_id, answer=outcome.answer)
        self.status = self.receiver.view(state=SenderState.SENDING)

    async def _wait_after(self, letter: StoredMessage, failed: Failed) -> None:
        now_ns, before = self._clock.now_ns(), self.status
        if before.n_failures == 0:
            found = {"receiver": self.receiver.name, "id": letter.event_id}
            log.warning("message not delivered; sending is repeated", **found, reason=failed.answer)
        await self._stored(lambda: self._outbox.fail(letter.id, failed.answer))
        await self._expire(failed.answer)
        n_failures = before.n_failures + 1
        pause_s = wait_s(n_failures, failed.retry_after_s, self.receiver.settings.max_retry_s)
        self.status = self.receiver.view(
            state=SenderState.RETRYING,
            n_failures=n_failures,
            failing_since_ns=before.failing_since_ns or now_ns,
            reason=failed.answer,
            next_attempt_ns=now_ns + ns_from_s(pause_s),
        )
        self._pulse.beat(pause_s)
        await self._clock.sleep(pause_s)

    async def _expire(self, answer: str) -> None:
        """Expire all messages that exceed the maximum age of the receiver, after a failed attempt.

        Forward steps of the host clock since the start of the sender do not count as age.
        """
        now = Arrival.now(self._clock)
        set_forward_s = max(0.0, now.step_s_since(self._begun))
        before_ns = now.host_ns - ns_from_s(
            set_forward_s + S_PER_H * self.receiver.settings.max_age_h
        )
        name = self.receiver.name
        words = f"expired after the last failure: {answer}"
        n_given_up = await self._stored(
            lambda: self._outbox.expire(name, before_ns, words, now.host_ns)
        )
        if n_given_up:
            log.error("undelivered messages expired", receiver=name, n=n_given_up, reason=answer)

    async def _stored(self, work: Callable[[], T], to_the_end: bool = False) -> T:
        """Run a store operation in a thread; repeat it until it succeeds, and return its result.

        Parameters
        ----------
        to_the_end
            Whether the operation is completed even if this task is cancelled.
        """
        while True:
            self._pulse.beat(STORE_RETRY_S)
            try:
                return await (_finished(work) if to_the_end else asyncio.to_thread(work))
            except StoreError as error:
                if self.status.state is not SenderState.STORE_FAILS:
                    log.error(
                        "the outbox cannot be read or written",
                        receiver=self.receiver.name,
                        reason=str(error),
                    )
                self._note(SenderState.STORE_FAILS)
                await self._clock.sleep(STORE_RETRY_S)

    async def _wake_up_or(self, duration_s: float) -> None:
        waiting = [
            asyncio.create_task(self._news.wait(), name="news"),
            asyncio.create_task(self._clock.sleep(duration_s), name="look"),
        ]
        try:
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
            await asyncio.wait(waiting)

    def _note(self, state: SenderState) -> None:
        self.status = replace(self.status, state=state, next_attempt_ns=None)


async def _finished(work: Callable[[], T]) -> T:
    """Run an operation in a thread and wait for its end even if this task is cancelled."""
    working = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return await asyncio.shield(working)
    except asyncio.CancelledError:
        await asyncio.wait([working])
        if not working.cancelled():
            working.exception()  # the message is sent again after the restart
        raise


class Deliveries:
    """Group of the senders of all receivers, which deliver independently of each other."""

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox, clock: Clock) -> None:
        self._senders = {each.name: Sender(each, outbox, clock) for each in receivers}
        self._outbox, self._clock = outbox, clock

    async def run(self, beats: Heartbeats | None = None) -> None:
        """Run all senders until the task is cancelled, with heartbeats in `beats` unless None."""
        beats = beats or Heartbeats(self._clock)
        loops = {f"deliver {name}": sender.run for name, sender in self._senders.items()}
        try:
            async with asyncio.TaskGroup() as tasks:
                for name, loop in loops.items():
                    tasks.create_task(beats.tend(name, loop), name=name)
        except asyncio.CancelledError:
            beats.release(*loops)  # another process takes over the delivery
            raise

    def wake(self) -> None:
        """Wake all senders, which check the outbox immediately."""
        for sender in self._senders.values():
            sender.wake()

    @property
    def statuses(self) -> tuple[ReceiverView, ...]:
        """Receivers of the plant file with the status of their senders."""
        return tuple(each.status for each in self._senders.values())

    async def look(self) -> list[ReceiverView]:
        """Return the delivery statistics and the status of the sender of each receiver.

        Raises `StoreError` if the outbox cannot be read.
        """
        return await asyncio.to_thread(with_backlogs, self.statuses, self._outbox)
